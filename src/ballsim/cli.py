"""The command line: what the user types, and the exit codes.

Heavy imports (MuJoCo, NumPy, rerun) happen inside the commands, so that
``ballsim --help`` answers at once.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import shlex
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path

from ballsim.errors import (
    BallsimError,
    ConfigError,
    MissingDependencyError,
    ReplayMismatchError,
)
from ballsim.module_parser import OneLineParser

__all__ = ["main", "make_parser"]

EXIT_DONE = 0
EXIT_INTERNAL_ERROR = 1
EXIT_BAD_INPUT = 2
EXIT_FELL = 3
EXIT_REPLAY_DIFFERS = 4
EXIT_INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: Words after the program's name, those of the process if None.

    Returns:
        Exit code: 0 done, 1 internal error, 2 bad input, 3 the robot fell,
        4 the replay differs.
    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    options = make_parser().parse_args(words)
    # The matrices are tiny: threads of the linear algebra would only spin. A library's
    # own variable, such as OPENBLAS_NUM_THREADS, beats this one.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    options.command_line = shlex.join(["ballsim", *words])
    command: Callable[[argparse.Namespace], int] = options.function
    try:
        return command(options)
    except (ConfigError, MissingDependencyError) as error:
        _complain(str(error))
        return EXIT_BAD_INPUT
    except ReplayMismatchError as error:
        _complain(str(error))
        return EXIT_REPLAY_DIFFERS
    except BallsimError as error:
        _complain(str(error))
        return EXIT_INTERNAL_ERROR
    except KeyboardInterrupt:
        _complain("interrupted")
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_DONE
    except Exception as error:
        _complain(f"internal error: {error!r}; traceback in {_dump_traceback()}")
        return EXIT_INTERNAL_ERROR


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line, with all commands."""
    parser = OneLineParser(
        prog="ballsim", description="A humanoid on a rolling ball, in full physics."
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    _add_run(commands.add_parser("run", help="one run of a scenario"))
    for name, function, text in (
        ("scenarios", _list_scenarios, "list the shipped scenarios"),
        ("controllers", _list_controllers, "list the registered controllers"),
        ("sensors", _list_sensors, "list the shipped sensor presets"),
    ):
        sub = commands.add_parser(name, help=text, description=text)
        sub.add_argument("--json", action="store_true", help="as JSON")
        if function is _list_sensors:
            sub.add_argument(
                "--parts", action="store_true", help="single parts instead of presets"
            )
        sub.set_defaults(function=function)
    text = "repeat a run and compare its trajectory bit for bit"
    sub = commands.add_parser("replay", help=text, description=text)
    sub.add_argument("folder", metavar="DIR", type=Path, help="folder of the run")
    sub.set_defaults(function=_replay)
    text = "Sections III to VI of the paper on its simplified model: figures, table"
    sub = commands.add_parser("paper", help=text, description=text)
    sub.add_argument("--out", metavar="DIR", type=Path, help="folder (runs/paper-...)")
    sub.add_argument("--json", action="store_true", help="paper.json on stdout, too")
    sub.set_defaults(function=_paper)
    _add_study(commands.add_parser("study", help="many runs, and their statistics"))
    _add_bench(commands.add_parser("bench", help="what a second of simulation costs"))
    text = "a page of figures of a run, beside its other files"
    sub = commands.add_parser("plot", help=text, description=text)
    sub.add_argument("folder", metavar="DIR", type=Path, help="folder of the run")
    sub.add_argument("--out", metavar="DIR", type=Path, help="folder of the figures")
    sub.set_defaults(function=_plot)
    text = "two runs over each other: figures, and a table of what differs"
    sub = commands.add_parser("compare", help=text, description=text)
    for name in ("first", "second"):
        sub.add_argument(name, metavar="DIR", type=Path, help="folder of a run")
    sub.add_argument("--out", metavar="DIR", type=Path, help="folder (runs/compare-)")
    sub.add_argument("--json", action="store_true", help="JSON on stdout, nothing else")
    sub.set_defaults(function=_compare)
    text = "open the log of a run in the rerun viewer"
    sub = commands.add_parser("view", help=text, description=text)
    sub.add_argument("path", metavar="DIR_OR_RRD", type=Path, help="run or recording")
    sub.add_argument("--web", action="store_true", help="in a browser")
    sub.set_defaults(function=_view)
    return parser


def _add_run(sub: argparse.ArgumentParser) -> None:
    sub.description = "One run; exit code 3 if the robot fell."
    add = sub.add_argument
    add("scenario", metavar="SCENARIO", help="name of a scenario or a TOML file")
    add("--ball-radius", metavar="R", help="radius of the ball [m]")
    add("--controller", metavar="NAME", help="see `ballsim controllers`")
    add("--sensors", metavar="PRESET", help="see `ballsim sensors`")
    add("--seed", metavar="N", help="seed of everything random")
    add("--duration", metavar="T", help="simulated time [s]")
    add("--out", metavar="DIR", type=Path, help="folder of the files (runs/...)")
    add(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        dest="overrides",
        help="change one value, dotted key; repeatable",
    )
    add("--no-log", action="store_true", help="write no rerun recording")
    add("--video", action="store_true", help="write run.mp4 too")
    add("--json", action="store_true", help="the summary on stdout, nothing else")
    text = "show it in a viewer while it runs at real time, commanded by keys and lines"
    add("--live", action="store_true", help=f"{text}: type help")
    text = "--live in a rerun viewer that runs: rerun+http://HOST:PORT/proxy"
    add("--live-connect", metavar="URL", help=text)
    sub.set_defaults(function=_run)


def _add_study(sub: argparse.ArgumentParser) -> None:
    sub.description = "A Monte-Carlo study; the same command goes on with a broken one."
    add = sub.add_argument
    add("study", metavar="STUDY.toml", type=Path, help="definition of the study")
    add("--out", metavar="DIR", type=Path, help="folder (runs/study-NAME)")
    add("--workers", metavar="N", help="local processes (one for each core)")
    add("--scheduler", metavar="ADDRESS", help="tcp://host:port of a Dask cluster")
    text = "results.parquet of an earlier one, whose runs are not done again"
    add("--from", dest="earlier", metavar="FILE", type=Path, help=text)
    text = "of these only those with such values of a factor; again for other factors"
    add("--where", metavar="KEY=V,V", action="append", default=[], help=text)
    add("--dry-run", action="store_true", help="how many runs and how long")
    add("--json", action="store_true", help="the numbers on stdout, nothing else")
    sub.set_defaults(function=_study)


def _add_bench(sub: argparse.ArgumentParser) -> None:
    sub.description = (
        "What a second of simulation costs, part by part, beside bare mj_step of the "
        "same scene, and what the log adds. Takes two minutes."
    )
    add = sub.add_argument
    add("--scenario", metavar="SCENARIO", help="(roll-to with target_angle=4)")
    add(
        "--ball-radius",
        metavar="R",
        action="append",
        default=[],
        help="radius of the ball [m]; repeatable (0.25, 0.5, 0.75 and 1)",
    )
    add("--controller", metavar="NAME", help="see `ballsim controllers`")
    add("--sensors", metavar="PRESET", help="see `ballsim sensors`")
    add("--duration", metavar="T", help="simulated time of each run [s] (8)")
    add(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        dest="overrides",
        help="change one value, dotted key; repeatable",
    )
    add("--repeats", metavar="N", help="best and median of N (3)")
    add("--workers", metavar="N", help="try 1, 2 and N processes (all cores)")
    add("--memory", action="store_true", help="memory against run length too")
    add("--batch", action="store_true", help="MuJoCo's batched stepping too")
    add("--quick", action="store_true", help="a look: 1 s once, no processes")
    add("--json", action="store_true", help="JSON on stdout, nothing else")
    sub.set_defaults(function=_bench)


def _run(options: argparse.Namespace) -> int:
    from ballsim.config_io import OPTION_KEYS
    from ballsim.run_command import RunOptions, run_command

    given = tuple(
        f"{key}={value}"
        for name, key in OPTION_KEYS.items()
        if (value := getattr(options, name)) is not None
    )
    asked = RunOptions(
        scenario=options.scenario,
        overrides=(*given, *options.overrides),
        out=options.out,
        is_logged=not options.no_log,
        has_video=options.video,
        is_live=options.live or options.live_connect is not None,
        viewer=options.live_connect,
        command_line=options.command_line,
    )
    finished = run_command(asked)
    if options.json:
        print(json.dumps(finished.summary, indent=2, allow_nan=False))
    else:
        from ballsim.console import print_summary

        print_summary(finished.summary, finished.folder)
    return EXIT_DONE if finished.outcome.is_upright else EXIT_FELL


def _list_scenarios(options: argparse.Namespace) -> int:
    from ballsim.config_io import list_scenarios

    return _print_list(list_scenarios(), options.json)


def _list_controllers(options: argparse.Namespace) -> int:
    from ballsim.controller_registry import list_controllers

    return _print_list(list_controllers(), options.json)


def _list_sensors(options: argparse.Namespace) -> int:
    from ballsim.sensor_presets import list_sensor_parts, list_sensor_presets

    found = list_sensor_parts() if options.parts else list_sensor_presets()
    return _print_list(found, options.json)


def _print_list(descriptions: dict[str, str], is_json: bool) -> int:
    if is_json:
        items = [{"name": n, "description": d} for n, d in descriptions.items()]
        print(json.dumps(items, indent=2))
        return EXIT_DONE
    width = max(map(len, descriptions), default=0)
    for name, description in descriptions.items():
        print(f"{name:<{width}}  {description}")
    return EXIT_DONE


def _replay(options: argparse.Namespace) -> int:
    from ballsim.replay import replay

    digest = replay(options.folder)
    print(f"identical: {digest}")
    return EXIT_DONE


def _paper(options: argparse.Namespace) -> int:
    from ballsim.paper.command import print_table, run_paper

    finished = run_paper(options.out, options.command_line)
    if options.json:
        print(json.dumps(finished.report, indent=1, allow_nan=False))
    else:
        print_table(finished.rows, finished.folder)
    return EXIT_DONE


def _study(options: argparse.Namespace) -> int:
    from ballsim.studies.command import choose_workers, print_study, run_study
    from ballsim.studies.dry_run import dry_run
    from ballsim.studies.earlier import choose_earlier

    n_workers = choose_workers(options.workers, options.scheduler)
    earlier = choose_earlier(options.earlier, options.where)
    how = (n_workers, options.scheduler, earlier)
    if options.dry_run:
        cost = dry_run(options.study, *how)
        if options.json:
            print(json.dumps(dataclasses.asdict(cost), indent=2))
        else:
            print(cost.describe(options.study.stem))
        return EXIT_DONE
    finished = run_study(options.study, options.out, *how)
    if options.json:
        print(json.dumps(finished.numbers, indent=1, allow_nan=False))
    else:
        print_study(finished)
    return EXIT_DONE


def _bench(options: argparse.Namespace) -> int:
    from ballsim.bench.command import BenchOptions, run_bench
    from ballsim.bench.table import print_report, show_status
    from ballsim.config_io import OPTION_KEYS

    given = (
        f"{OPTION_KEYS[name]}={value}"
        for name in ("controller", "sensors")
        if (value := getattr(options, name)) is not None
    )
    asked = BenchOptions(
        scenario=options.scenario,
        radii=tuple(options.ball_radius),
        duration=options.duration,
        overrides=(*given, *options.overrides),
        repeats=options.repeats,
        workers=options.workers,
        is_quick=options.quick,
        has_memory=options.memory,
        has_batch=options.batch,
    )
    with show_status() as notify:
        report = run_bench(asked, notify)
    if options.json:
        print(json.dumps(report, indent=2, allow_nan=False))
    else:
        print_report(report)
    return EXIT_DONE


def _plot(options: argparse.Namespace) -> int:
    from ballsim.inspection.page import plot_run

    for file in plot_run(options.folder, options.out):
        print(file)
    return EXIT_DONE


def _compare(options: argparse.Namespace) -> int:
    from ballsim.inspection.comparison import compare_runs

    comparison, folder = compare_runs(options.first, options.second, options.out)
    if options.json:
        table = {"settings": comparison.settings, "numbers": comparison.numbers}
        print(json.dumps(table, indent=2, allow_nan=False))
        return EXIT_DONE
    print(comparison.format_markdown())
    print(f"files in {folder}")
    return EXIT_DONE


def _view(options: argparse.Namespace) -> int:
    from ballsim.console import open_viewer

    return open_viewer(options.path, options.web)


def _complain(message: str) -> None:
    print(f"ballsim: {message}", file=sys.stderr)


def _dump_traceback() -> str:
    handle, path = tempfile.mkstemp(prefix="ballsim-traceback-", suffix=".txt")
    with os.fdopen(handle, "w") as file:
        traceback.print_exc(file=file)
    return path
