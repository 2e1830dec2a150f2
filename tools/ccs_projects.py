"""Write the Code Composer projects of the C2000 boards from CMake's build.

`python tools/ccs_projects.py` writes firmware/port/c2000/ccs/*.projectspec. It also writes into the
linker command files of the flash images the names of the files whose functions stay in flash. CMake
builds with a stand-in for the compiler, which compiles nothing and logs its arguments. A project
takes sources, defines, options and linker command file from this log.
`tests/project/test_ccs_projects.py` checks that the projects are current.
"""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

ROOT = Path(__file__).resolve().parents[1]
FIRMWARE = ROOT / "firmware"
CCS = FIRMWARE / "port" / "c2000" / "ccs"
#: Preset of CMakePresets.json -> board of ht_board.c, device as Code Composer names it.
BOARDS = {
    preset["name"]: (values["HT_BOARD"], f"TMS320{values['HT_DEVICE'].upper()}")
    for preset in json.loads((ROOT / "CMakePresets.json").read_text())["configurePresets"]
    if "HT_BOARD" in (values := preset.get("cacheVariables", {}))
}
#: The compiler that the options are made for; Code Composer offers another one it has.
COMPILER = "22.6.1.LTS"
#: The only option that files differ in. A project has it for all; the flash's linker command
#: file keeps the others where they are, by name.
RAM = "--ramfunc=on"

#: CMake's look at the compiler goes to the host's, under TI's macros; the rest is noted. In a noted
#: word a blank has a backslash before it.
STAND_IN = r"""#!/bin/sh
words=$(printf '%s\n' "$0" "$@" | sed 's/[\\ ]/\\&/g' | tr '\n' ' ')
# In one piece: others that run at the same time write to it, too.
printf '%s\n' "$words" > "{log}.$$"
cat "{log}.$$" >> "{log}"
rm "{log}.$$"
out=
source=
for word in "$@"; do
  case "$word" in
    --output_file=*) out="${{word#*=}}" ;;
    *CMakeCCompilerId.c) source="$word" ;;
    -h) echo "Texas Instruments" ; exit 0 ;;
  esac
done
if [ -n "$source" ]; then
  exec "{cc}" -U__GNUC__ -D__TI_COMPILER_VERSION__=22006001 -D__TMS320C28XX__=1 -c "$source"
fi
[ -n "$out" ] && : > "$out"
exit 0
"""


def tool(name: str) -> str | None:
    """A program beside this Python, or on the path."""
    beside = Path(sys.executable).parent / name
    return str(beside) if beside.exists() else shutil.which(name)


CMAKE, NINJA, CC = tool("cmake"), tool("ninja"), shutil.which("gcc") or shutil.which("cc")


def stand_in(folder: Path, log: Path) -> None:
    """Make a TI_CGT_ROOT whose programs write their calls into `log`."""
    (folder / "bin").mkdir(parents=True, exist_ok=True)
    for name in ("cl2000", "ar2000"):
        program = folder / "bin" / name
        program.write_text(STAND_IN.format(log=log, cc=CC))
        program.chmod(0o755)


@dataclass
class Image:
    """The compiler's arguments for one image. stays: the C files whose functions stay in flash."""

    sources: list[Path]
    stays: set[str]
    options: list[str]
    folders: list[Path]
    link: list[str]
    command_file: Path


def _words(text: str, pattern: str) -> Iterator[str]:
    for word in shlex.split(text):
        found = re.fullmatch(pattern, word)
        if found:
            yield found[1]


def image(calls: list[str], name: str) -> Image:
    """The image `name`.out, from the calls that the stand-in has logged."""
    compiled = [c for c in calls if " --compile_only " in c and f"/{name}.dir/" in c]
    (linked,) = (c for c in calls if " --run_linker " in c and f"--output_file={name}.out" in c)
    sources = [path for c in compiled for path in _words(c, r"--(?:c|asm)_file=(.*)")]
    of_c = [c for c in compiled if "--c_file=" in c]
    folders = [*_words(of_c[0], r"--include_path=(.*)")]
    skip = r"--(?:compile_only|c_file|include_path|preproc_\w+|output_file)\b.*|-DHT_BUILD=.*"
    options, stays = set(), set()
    for call in of_c:
        words = [w for w in shlex.split(call)[1:] if not re.fullmatch(skip, w)]
        if RAM not in words:
            stays |= {Path(path).stem for path in _words(call, r"--c_file=(.*)")}
            words.append(RAM)
        options.add((*(w for w in words if w != RAM), RAM))
    if len(options) != 1:
        raise ValueError(f"{name}: files with options of their own, which a project cannot have")
    skip = r"--(?:run_linker|output_file|map_file|search_path)\b.*|.*\.obj|.*\.cmd"
    link = [w for w in shlex.split(linked)[1:] if not re.fullmatch(skip, w)]
    (command_file,) = _words(linked, r"(.*\.cmd)")
    return Image(
        sorted(map(Path, sources)), stays, [*options.pop()], [*map(Path, folders)], link,
        Path(command_file),
    )  # fmt: skip


def calls_of(preset: str, source: Path = ROOT) -> list[str]:
    """Every call of compiler and linker in the build of a preset."""
    if not (CMAKE and NINJA and CC):
        raise SystemExit("cmake, ninja and gcc are needed")
    with tempfile.TemporaryDirectory() as folder:
        log, build = Path(folder, "log"), Path(folder, "build")
        stand_in(Path(folder, "ti"), log)
        configure: list[str | Path] = [
            CMAKE, "--preset", preset, "-B", build, "-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={NINJA}",
        ]  # fmt: skip
        environment = os.environ | {"TI_CGT_ROOT": str(Path(folder, "ti"))}
        build_step: list[str | Path] = [CMAKE, "--build", build]
        for step in (configure, build_step):
            log.write_text("")
            done = subprocess.run(step, cwd=source, env=environment, capture_output=True, text=True)
            if done.returncode:
                raise SystemExit(done.stdout + done.stderr)
        return log.read_text().splitlines()


def project(preset: str, calls: list[str], source: Path = ROOT) -> str:
    """The text of a preset's projectspec."""
    board, device = BOARDS[preset]
    places = {p: image(calls, f"hexatorque_{board}_{p}") for p in ("flash", "ram")}
    flash, ram = places["flash"], places["ram"]
    if (flash.sources, flash.folders) != (ram.sources, ram.folders):
        raise ValueError(f"{board}: flash and RAM are made of different sources")
    firmware = source / "firmware"
    top = Path("../../..")  # of the firmware, from the projectspec

    def path(file: Path) -> str:
        return quoteattr(str(top / file.relative_to(firmware)))

    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        "<!-- Written by tools/ccs_projects.py from what CMake builds: change that, not this. -->",
        "<projectSpec>",
        f'  <project name="hexatorque_{board}" device="{device}" cgtVersion="{COMPILER}"',
        '           outputFormat="ELF" launchWizard="False" linkerCommandFile="">',
        '    <pathVariable name="HT_FIRMWARE" path="../../.." scope="project" />',
    ]
    for place, made in places.items():
        include = [f"-I${{HT_FIRMWARE}}/{f.relative_to(firmware)}" for f in made.folders]
        lines += [
            f'    <configuration name="{place}"',
            f"        compilerBuildOptions={quoteattr(' '.join(made.options + include))}",
            f"        linkerBuildOptions={quoteattr(' '.join(made.link))} />",
        ]
    lines += [
        f'    <file action="link" path={path(made.command_file)} targetDirectory=""'
        f' applicableConfigurations="{place}" />'
        for place, made in places.items()
    ]
    lines.append(
        f'    <file action="copy" path="{device}.ccxml" targetDirectory="targetConfigs" />'
    )
    lines += [
        f'    <file action="link" path={path(file)}'
        f" targetDirectory={quoteattr(str(file.parent.relative_to(firmware)))} />"
        for file in flash.sources
    ]
    return "\n".join([*lines, "  </project>", "</projectSpec>", ""])


def stays(command_file: str, names: set[str]) -> str:
    """The text of a flash's linker command file that keeps these files' functions there."""
    first, *rest = (f"*{name}.*(.TI.ramfunc)" for name in sorted(names, key=lambda n: n != "main"))
    body = "".join(f"\n{' ' * 20}{section}" for section in sorted(rest))
    return re.sub(
        r"(\.stays +: \{).*?\}", lambda m: f"{m[1]} {first}{body} }}", command_file, flags=re.S
    )


def file_of(preset: str) -> Path:
    return CCS / f"hexatorque_{BOARDS[preset][0]}.projectspec"


def main() -> None:
    for preset, (board, _) in BOARDS.items():
        calls = calls_of(preset)
        file_of(preset).write_text(project(preset, calls))
        made = image(calls, f"hexatorque_{board}_flash")
        made.command_file.write_text(stays(made.command_file.read_text(), made.stays))


if __name__ == "__main__":
    main()
