"""The command line: `palpate VERB`."""

from __future__ import annotations

import os
import sys
from typing import NoReturn

import typer

from palpate.app.commands import (
    blind,
    data,
    demo,
    diagnosis,
    evaluation,
    export,
    importing,
    look_verb,
    service,
    surface,
    sweeping,
    training,
)
from palpate.app.commands.console import errors, print_problem
from palpate.app.jobs.signals import stop
from palpate.foundation.errors import Cancelled, PalpateError

__all__ = ["app", "main"]

BAD_INPUT = 2
CANCELLED = 130

app = typer.Typer(
    name="palpate",
    help="Replay palpation of soft tissue, see what the simulation gets wrong, and name the cause.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.command()(demo.demo)
app.command()(data.check)
app.command("import")(importing.import_)
app.command()(look_verb.look)
app.command()(surface.surface)
app.command()(data.register)
app.command()(data.replay)
app.command()(diagnosis.diagnose)
app.command()(sweeping.sweep)
app.command()(training.train)
app.command()(evaluation.evaluate)
app.command()(export.export)
app.command()(blind.blind)
app.command()(service.serve)
app.command()(service.doctor)


def main() -> NoReturn:
    """Run a command. Exit codes: 0 when it is done, 2 with one clear message for bad input, 130
    when it was stopped.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    stop.listen()
    try:
        app()
    except PalpateError as error:
        print_problem(error)
        sys.exit(BAD_INPUT)
    except (Cancelled, KeyboardInterrupt):
        sys.exit(_cancelled())
    except Exception:
        if not stop.received:
            raise
        # A signal during an import may appear as any exception of that import.
        sys.exit(_cancelled())
    except SystemExit as end:
        if end.code == CANCELLED:
            _cancelled()
        raise
    sys.exit(0)


def _cancelled() -> int:
    errors.print("cancelled; nothing was left half done", highlight=False)
    return CANCELLED


if __name__ == "__main__":
    main()
