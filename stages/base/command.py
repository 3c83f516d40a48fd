"""The command lines of stages.commands: each says what it does, and shows how it is called."""

import argparse


def parser(name: str, description: str | None, *examples: str) -> argparse.ArgumentParser:
    """For `python -m stages.commands.NAME`.

    Args:
        name: the module's.
        description: its docstring.
        examples: command lines.
    """
    return argparse.ArgumentParser(
        prog=f"python -m stages.commands.{name}",
        description=description,
        epilog="\n  ".join(["examples:", *examples]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
