"""Recorders: what is kept of a run for the eye."""

import os

# Rerun's library reads this when it is loaded. It would warn of every long recording,
# which has no index on purpose: see `rerun_recorder`.
os.environ.setdefault("RUST_LOG", "warn,re_log_encoding::rrd::file_sink=error")
