"""HTML reports, from the templates in `templates/`."""

from __future__ import annotations

from pathlib import Path

from .. import __version__


def write_page(path: Path, template: str, **values: object) -> Path:
    """Write a report; returns its path. All values are escaped, so a name that looks like HTML is
    shown as text. A template that asks for a value that is not given is an error."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    pages = Environment(
        loader=PackageLoader(__package__), undefined=StrictUndefined, autoescape=True,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    text = pages.get_template(template).render(version=__version__, **values)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path
