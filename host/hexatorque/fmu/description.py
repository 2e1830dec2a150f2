"""The model descriptions of FMI 2.0 and FMI 3.0, written from the same variables."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from .. import __version__
from .variables import CHOICE, FLAG, OUTPUT, PARAMETER, REAL, TIME, WHOLE, Variable

#: A description of each kind of FMU.
ABOUT = {
    "controller": "Six-phase drive controller, the firmware with its registers",
    "drive": "Six-phase drive: the firmware with its registers, inverter, machine and sensors",
}
TOOL = f"hexatorque {__version__}"
#: Elements of the types, by kind.
TYPES = {
    2: {REAL: "Real", FLAG: "Boolean", WHOLE: "Integer", CHOICE: "Enumeration"},
    3: {REAL: "Float64", FLAG: "Boolean", WHOLE: "Int32", CHOICE: "Enumeration"},
}


def identifier(of: str) -> str:
    """Name of the binaries and of the prefix of the model."""
    return f"hexatorque_{of}"


def _text(root: Element) -> bytes:
    ElementTree.indent(root)
    return ElementTree.tostring(root, "UTF-8", xml_declaration=True) + b"\n"


def _number(kind: int, value: float) -> str:
    if kind == FLAG:
        return "true" if value else "false"
    return repr(float(value)) if kind == REAL else str(int(value))


def _common(variable: Variable) -> dict[str, str]:
    """Attributes that both versions have, in the same element or not."""
    attributes = {
        "name": variable.name,
        "valueReference": str(variable.reference),
        "description": variable.help,
        "causality": variable.role,
    }
    if variable.role == PARAMETER:
        attributes["variability"] = "tunable" if variable.live else "fixed"
        attributes["initial"] = "exact"
    elif variable.role == TIME:
        attributes["variability"] = "continuous"
    elif variable.role == OUTPUT or variable.kind != REAL:
        attributes["variability"] = "discrete"
    return {name: text for name, text in attributes.items() if text}


def _typed(variable: Variable) -> dict[str, str]:
    """Attributes of the type."""
    attributes = {}
    if variable.choices:
        attributes["declaredType"] = _type_of(variable)
    elif variable.kind == REAL and variable.unit:
        attributes["unit"] = variable.unit
    if not variable.choices and variable.min is not None and variable.max is not None:
        attributes["min"] = _number(variable.kind, variable.min)
        attributes["max"] = _number(variable.kind, variable.max)
    if variable.start is not None:
        attributes["start"] = _number(variable.kind, variable.start)
    return attributes


def _type_of(variable: Variable) -> str:
    return f"choice.{variable.name.rpartition('.')[2]}"


def _units(root: Element, variables: Iterable[Variable]) -> None:
    units = SubElement(root, "UnitDefinitions")
    named = {v.unit for v in variables if v.kind == REAL and v.unit}
    for unit in sorted(named):
        SubElement(units, "Unit", name=unit)


def _choices(root: Element, variables: Iterable[Variable], version: int) -> None:
    types = SubElement(root, "TypeDefinitions")
    for variable in variables:
        if not variable.choices:
            continue
        if version == 2:
            simple = SubElement(types, "SimpleType", name=_type_of(variable))
            items = SubElement(simple, "Enumeration")
        else:
            items = SubElement(types, "EnumerationType", name=_type_of(variable))
        for number, name in enumerate(variable.choices):
            SubElement(items, "Item", name=name, value=str(number))


def _logs(root: Element) -> None:
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", name="logStatusWarning")
    SubElement(categories, "Category", name="logStatusError")


def model_description(
    of: str,
    version: int,
    title: str,
    token: str,
    period_s: float,
    variables: list[Variable],
    sources: Iterable[str],
) -> bytes:
    """The file modelDescription.xml. of: the kind of FMU; version: of FMI, 2 or 3;
    token: the identity that the binary checks; sources: files with code, as `sources` has
    them."""
    identity = "guid" if version == 2 else "instantiationToken"
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{version}.0",
            "modelName": f"hexatorque {of}",
            identity: token,
            "description": f"{ABOUT[of]}: {title}",
            "license": "MIT",
            "generationTool": TOOL,
            "variableNamingConvention": "structured",
        },
    )
    flags = ("canGetAndSetFMUstate", "canSerializeFMUstate")
    if version == 3:
        flags = ("canGetAndSetFMUState", "canSerializeFMUState")
    simulation = SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": identifier(of),
            "canHandleVariableCommunicationStepSize": "true",
            **dict.fromkeys(flags, "true"),
        },
    )
    if version == 2:
        simulation.set("canNotUseMemoryManagementFunctions", "true")
        files = SubElement(simulation, "SourceFiles")
        for name in sources:
            SubElement(files, "File", name=name)
    else:
        simulation.set("fixedInternalStepSize", repr(period_s))
    _units(root, variables)
    _choices(root, variables, version)
    _logs(root)
    SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=repr(period_s))
    listed = SubElement(root, "ModelVariables")
    for v in variables:
        if version == 2:
            inside = SubElement(listed, "ScalarVariable", _common(v))
            SubElement(inside, TYPES[2][v.kind], _typed(v))
        else:
            SubElement(listed, TYPES[3][v.kind], {**_common(v), **_typed(v)})
    _structure(root, variables, version)
    return _text(root)


def _structure(root: Element, variables: list[Variable], version: int) -> None:
    """No output depends on the inputs of the same instant: a step is between them."""
    structure = SubElement(root, "ModelStructure")
    outputs = [(n, v) for n, v in enumerate(variables, 1) if v.role == OUTPUT]
    if version == 3:
        for name in ("Output", "InitialUnknown"):
            for _, v in outputs:
                SubElement(structure, name, valueReference=str(v.reference), dependencies="")
        return
    for name in ("Outputs", "InitialUnknowns"):
        group = SubElement(structure, name)
        for number, _ in outputs:
            SubElement(group, "Unknown", index=str(number), dependencies="")


def build_description(of: str, sources: Iterable[str], options: str) -> bytes:
    """The file sources/buildDescription.xml of FMI 3.0."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    build = SubElement(root, "BuildConfiguration", modelIdentifier=identifier(of))
    files = SubElement(build, "SourceFileSet", language="C99", compilerOptions=options)
    for name in sources:
        SubElement(files, "SourceFile", name=name)
    return _text(root)
