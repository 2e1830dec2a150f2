"""Python's reference on the site: a method that overrides one, without a text of its own, has the
text of the one that it overrides. An extension of griffe, which reads the sources for mkdocstrings.
"""

from typing import Any

import griffe


class InheritedTexts(griffe.Extension):
    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        self._inherit(pkg)

    def _inherit(self, within: griffe.Object) -> None:
        for member in within.members.values():
            if member.is_alias:
                continue
            if member.is_class:
                self._of_class(member)
            if member.is_module or member.is_class:
                self._inherit(member)

    def _of_class(self, one: griffe.Class) -> None:
        for name, member in one.members.items():
            if member.is_alias or member.docstring:
                continue
            for base in one.mro():
                if name in base.members and base.members[name].docstring:
                    member.docstring = base.members[name].docstring
                    break
