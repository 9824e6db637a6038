"""Entity paths of the recording that do not belong to a signal."""

from __future__ import annotations

__all__ = [
    "BALL_TOP_PATH",
    "CONFIG_PATH",
    "EVENTS_PATH",
    "FALL_PATH",
    "FOCUS_PATH",
    "FOLLOW_PATH",
    "PHASE_PATH",
    "SPEED_PATH",
    "TOP_PATH",
]

CONFIG_PATH = "/config"
EVENTS_PATH = "/events"
FALL_PATH = "/world/fall"
PHASE_PATH = "/control/gait_phase"
SPEED_PATH = "/performance/realtime_factor"
TOP_PATH = "/ball_top"

# Frames that follow the ball. The views have them as origins, which keeps the ball in
# the middle; an eye that tracks an entity would do so from the first mouse drag only.
FOLLOW_PATH = "/world/follow"
FOCUS_PATH = f"{FOLLOW_PATH}/focus"
BALL_TOP_PATH = f"{FOLLOW_PATH}/ball_top"
