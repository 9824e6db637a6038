"""The tables of a report, as text cells; pure functions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

__all__ = ["Section", "describe", "make_sections"]

_OVERHEAD = {
    "prepare": "prepare: scene, gains, controller",
    "loop_set_up": "set the loop up",
    "summary": "summary",
    "files": "files without the recording",
    "recording": "open and close the recording",
}
_COST = ("median", "of_least")
_STARTUP = {
    "help": "`ballsim --help`",
    "first_step": "`ballsim run stand` to its first step",
    "first_step_no_log": "the same with `--no-log`",
    "first_step_empty_cache": "the same, all caches empty",
}


@dataclass(frozen=True, slots=True)
class Section:
    """One table.

    Attributes:
        title: What it shows.
        head: Name of each column; those after the first are numbers.
        rows: Cells.
        note: A sentence below the table, or empty.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


def make_sections(report: Mapping[str, Any]) -> list[Section]:
    """Return the tables of a report, those that were not measured left out.

    Args:
        report: As `ballsim.bench.command.run_bench` returns it.
    """
    sections = [
        _make_balls(report),
        _make_parts(report),
        _make_log(report["log"]),
        Section(
            "A run besides its loop",
            ("", "ms"),
            tuple(
                (_OVERHEAD[name], f"{value:.1f}")
                for name, value in report["overhead_ms"].items()
            ),
        ),
        Section(
            "Start-up, from the spawn of the process",
            ("", "best s", "median s"),
            tuple(
                (_STARTUP[name], f"{times['best']:.2f}", f"{times['median']:.2f}")
                for name, times in report["startup_s"].items()
            ),
        ),
    ]
    if report["scaling"] is not None:
        sections.append(_make_scaling(report["scaling"]))
    if report["batch"] is not None:
        sections.append(_make_batch(report["batch"]))
    if report["memory"] is not None:
        sections.append(_make_memory(report["memory"]))
    return sections


def describe(report: Mapping[str, Any]) -> Iterator[str]:
    """Yield lines that say what was measured, and on what."""
    machine, settings = report["machine"], report["settings"]
    versions = machine["versions"]
    names = ("python", "mujoco", "mink", "numpy")
    shown = ", ".join(f"{name} {versions[name]}" for name in names if name in versions)
    busy = _describe_load(machine)
    yield f"{machine['cpu']}, {machine['cores']} cores{busy}; {shown}"
    scenario = " ".join([settings["scenario"], *settings["overrides"]])
    yield (
        f"{scenario}, {settings['controller']}, sensors {settings['sensors']}: "
        f"{settings['duration']:g} s at {1 / settings['control_period']:g} Hz control, "
        f"{settings['physics_steps_per_tick']} physics steps a tick; "
        f"{settings['repeats']} repeats"
    )


def _describe_load(measured: Mapping[str, Any]) -> str:
    loads = measured["load_before"], measured["load_after"]
    return "" if None in loads else ", load {:.1f} before, {:.1f} after".format(*loads)


def _make_balls(report: Mapping[str, Any]) -> Section:
    rows = []
    for ball in report["balls"]:
        factors, shares = ball["realtime_factor"], ball["of_bare"]
        rows.append(
            (
                f"{ball['ball_radius']:g} m" + ("" if ball["survived"] else ", fell"),
                *(_pair(factors[name], ".1f") for name in factors),
                *(_pair(shares[name], ".2f", "of_best") for name in shares),
                f"{ball['bare_us_per_step']['median']:.1f}",
            )
        )
    head = (
        "ball",
        "closed",
        "recorded",
        "bare",
        "closed/bare",
        "recorded/bare",
        "us/step",
    )
    note = (
        "Times real time, the loop alone, without and with its recording: median "
        "(best) of the repeats; ratios: median of the repeats (ratio of the best "
        "times). Bare physics is mj_step with the same inputs to the same last state, "
        "bit for bit; us/step is one of its physics steps."
    )
    return Section("Closed loop beside bare physics", head, tuple(rows), note)


def _make_parts(report: Mapping[str, Any]) -> Section:
    parts = report["parts"]
    rows = tuple(
        (
            row["part"],
            f"{row['us_per_tick']:.1f}",
            f"{100.0 * row['share']:.1f}",
            *(
                "" if row[key] is None else f"{row[key]:{form}}"
                for key, form in (
                    ("calls_per_tick", ".2f"),
                    ("us_per_call_median", ".1f"),
                    ("us_per_call_p99", ".1f"),
                )
            ),
        )
        for row in parts["rows"]
    )
    ball = next(
        ball for ball in report["balls"] if ball["ball_radius"] == parts["ball_radius"]
    )
    n_ticks = ball["simulated_time"] / report["settings"]["control_period"]
    untimed = 1e6 * min(ball["loop_s"]["closed"]) / n_ticks
    note = (
        f"A tick takes {parts['tick_us']:.0f} us with the timers' own "
        f"{parts['wrapper_ns']} ns a call subtracted, {untimed:.0f} us without timers. "
        "Each part is without the parts that it calls. The recording comes on top."
    )
    if "encoding_us" in parts:
        note += (
            f" Beside the loop its own process takes {parts['encoding_us']:.0f} us of "
            "CPU a tick to encode it."
        )
    return Section(
        f"Parts of a tick, ball of {parts['ball_radius']:g} m",
        ("part", "us/tick", "% of tick", "calls/tick", "us/call, median", "p99"),
        rows,
        note,
    )


def _make_log(log: Mapping[str, Any]) -> Section:
    rows = [
        (
            label,
            *(f"{min(log[key][name]):.2f}" for name in ("without", "with")),
            "{} ({})".format(
                *(f"{100.0 * log['cost'][kind][name]:.1f}" for name in _COST)
            ),
        )
        for label, key, kind in (
            ("loop, s of wall time", "loop_s", "wall"),
            ("loop, s of CPU", "loop_cpu_s", "cpu"),
        )
    ]
    share = 100.0 * log["process_cpu_s"] / min(log["loop_cpu_s"]["without"])
    size = f"{log['recording_mb']:.2f}"
    rows += [
        (
            "its own process, s of CPU",
            "",
            f"{log['process_cpu_s']:.2f}",
            f"{share:.0f}",
        ),
        ("recording, MB", "", size, ""),
        ("recording, MB a minute", "", f"{log['mb_per_minute']:.2f}", ""),
    ]
    note = (
        f"{log['simulated_time']:g} s on the ball of {log['ball_radius']:g} m, all "
        "other files written in both. Times: the least of the repeats. Cost: what the "
        "log adds, as a part of the loop without it, median of the pairs (of the least "
        "times). The loop only hands its rows over; a process of its own encodes them "
        "on another core. Where none is free the loop waits for it, which shows in the "
        f"wall time{_describe_load(log)}. 1 MB = 1e6 bytes."
    )
    head = ("", "without", "with the log", "cost %")
    return Section("What the log costs", head, tuple(rows), note)


def _make_scaling(rows: Sequence[Mapping[str, float]]) -> Section:
    cells = tuple(
        (
            f"{row['workers']}",
            f"{row['throughput']:.1f}",
            f"{100.0 * row['efficiency']:.0f}",
        )
        for row in rows
    )
    return Section(
        "Processes running a study",
        ("processes", "simulated s / wall s", "efficiency %"),
        cells,
        "Prepare, loop and summary; the trajectories do not depend on the number.",
    )


def _make_batch(rows: Sequence[Mapping[str, Any]]) -> Section:
    counts = sorted({row["sims"] for row in rows})
    ways = dict.fromkeys((row["way"], row["threads"]) for row in rows)
    table = {(row["way"], row["threads"], row["sims"]): row for row in rows}
    cells = tuple(
        (
            f"{way}, {threads} thread{'s' if threads > 1 else ''}",
            *(f"{table[way, threads, n]['us_per_sim_tick']:.1f}" for n in counts),
            "yes"
            if all(table[way, threads, n]["is_identical"] for n in counts)
            else "no",
        )
        for way, threads in ways
    )
    return Section(
        "Batched stepping, us per simulation and tick",
        ("way", *(f"{n} sim{'s' if n > 1 else ''}" for n in counts), "same bits"),
        cells,
        "Physics alone, one call a tick for all simulations.",
    )


def _make_memory(rows: Sequence[Mapping[str, Any]]) -> Section:
    cells = tuple(
        (
            f"{row['simulated_time']:.0f} s",
            f"{row['peak_memory']:.1f}",
            f"{row['recording_size']:.1f}",
        )
        for row in rows
    )
    growth = rows[-1]["peak_memory"] - rows[0]["peak_memory"]
    return Section(
        "Memory against the length of a run",
        ("run, with its log", "peak MiB", "recording MiB"),
        cells,
        f"From the first to the last the peak grows by {growth:.1f} MiB.",
    )


def _pair(spread: Mapping[str, float], form: str, other: str = "best") -> str:
    return f"{spread['median']:{form}} ({spread[other]:{form}})"
