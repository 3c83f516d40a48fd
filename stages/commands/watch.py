"""`python -m stages.commands.watch` (`make watch`): what a sweep, or any stage, that runs elsewhere on this clone does.

Runs done and in flight, time left, and the last fault; nothing is started, and nothing of the work is touched.
"""

import sys
import time
from collections.abc import Iterator
from datetime import datetime

from rich.console import Console
from rich.live import Live
from rich.text import Text

from stages.base import command, paths, watched

QUIET = 120.0  # s of silence that are worth a word
LINES = 1  # of a traceback, from its end


def main(arguments: list[str] | None = None) -> int:
    """Say it once, or until Ctrl-C."""
    parser = command.parser("watch", __doc__, "make watch", "python -m stages.commands.watch --once")
    parser.add_argument("--once", action="store_true", help="say it once, and end")
    parser.add_argument("--every", type=float, default=1.0, metavar="S", help="seconds between looks (default: 1)")
    options = parser.parse_args(arguments)
    console = Console()
    if options.once or not console.is_terminal:
        print("\n".join(lines()))
        return 0
    try:
        with Live("", console=console, auto_refresh=False) as live:
            while True:
                live.update(Text("\n".join(lines())), refresh=True)
                time.sleep(max(0.1, options.every))
    except KeyboardInterrupt:
        return 0


def lines() -> Iterator[str]:
    """What there is to say now, as lines."""
    found = list(watched.words())
    if not found:
        yield f"No stage is at work (by {paths.store()})."
    for word in found:
        stage = word.stage.rpartition(":")[2] or "a command"
        silent = f" (silent for {word.silent():.0f} s)" if word.silent() > QUIET else ""
        yield f"{stage} in {word.folder}, process {word.pid} on {word.node}{silent}"
        yield f"  {word.text}"
    log = paths.log()
    if log.exists() and (text := log.read_text(encoding="utf-8", errors="replace").strip()):
        when = datetime.fromtimestamp(log.stat().st_mtime).astimezone().isoformat(sep=" ", timespec="seconds")
        yield f"Last fault, {when}: {text.splitlines()[-LINES]} (see {log})"


if __name__ == "__main__":
    sys.exit(main())
