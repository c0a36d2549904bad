"""Kinds of options, as `--help` shows them: a word for what is given, and no default where there is none to tell."""

from pathlib import Path
from typing import Annotated, Final

import tyro

HELP: Final = (
    tyro.conf.OmitArgPrefixes,
    tyro.conf.FlagCreatePairsOff,
    tyro.conf.DisallowNone,
    tyro.conf.PositionalMetavarFromFieldName,
)
"""How all commands take their options: --json without --no-json, and no `None` among what may be given."""

Text = Annotated[str | None, tyro.conf.arg(metavar="TEXT", help_behavior_hint="")]
Name = Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="")]
Names = Annotated[str | None, tyro.conf.arg(metavar="A,B,..", help_behavior_hint="")]
Number = Annotated[float | None, tyro.conf.arg(metavar="X", help_behavior_hint="")]
Whole = Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")]
File = Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")]
Output = Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="", aliases=["-o"])]
Folder = Annotated[Path | None, tyro.conf.arg(metavar="FOLDER", help_behavior_hint="")]
Kept = Annotated[Path, tyro.conf.arg(metavar="FOLDER")]
"""A folder with a default."""
Flag = Annotated[bool, tyro.conf.arg(help_behavior_hint="")]
"""Something that is off unless it is given, or on unless its --no- is."""
Count = Annotated[int, tyro.conf.arg(metavar="N")]
"""A whole number with a default."""
Amount = Annotated[float, tyro.conf.arg(metavar="X")]
"""A number with a default."""
