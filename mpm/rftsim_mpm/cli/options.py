"""How commands take their options, and how `--help` shows them."""

from pathlib import Path
from typing import Annotated, Any, Final

import tyro
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

HELP: Final = (
    tyro.conf.OmitArgPrefixes,
    tyro.conf.OmitSubcommandPrefixes,
    tyro.conf.FlagCreatePairsOff,
    tyro.conf.DisallowNone,
    tyro.conf.PositionalMetavarFromFieldName,
)
"""How all commands take their options: --json without --no-json, and no `None` among what may be given."""
KINDS: Final = ConstructorRegistry()
"""Kinds of options of ours."""

File = Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")]
Text = Annotated[str | None, tyro.conf.arg(metavar="TEXT", help_behavior_hint="")]
Flag = Annotated[bool, tyro.conf.arg(help_behavior_hint="")]
"""Something that is off unless it is given."""


@KINDS.primitive_rule
def number_or_ours(kind: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    """A number; of one that a study finds by itself where none is given, `auto` stands for that."""
    if kind.type not in (float, float | None):
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="X",
        instance_from_str=lambda words: float(words[0]),
        is_instance=lambda value: value is None or isinstance(value, int | float),
        str_from_instance=lambda value: ["auto" if value is None else str(value)],
    )
