"""Half a minute of the view at 200 Hz; `soak.py` does the same for any duration."""

from __future__ import annotations

import pytest

from web.soak import MAX_GROWTH_MB, soak

pytestmark = [pytest.mark.xdist_group("browser"), pytest.mark.slow]


@pytest.mark.usefixtures("image", "native_library")
def test_half_a_minute_at_200_hz_neither_grows_nor_loses_a_log_sample(tmp_path):
    found = soak(tmp_path, seconds=18.0, warm_s=12.0, min_runs=2)
    assert found.runs >= 3
    assert found.dropped == 0, found
    # After 12 s of warming up a sound view grows by 3 MB in 20 s, whatever it keeps for good included.
    assert found.max_growth_mb < MAX_GROWTH_MB / 2, found
    # A picture takes as many as a strip of its chart has pixels; a slow page draws an even choice.
    assert found.live_hz > 60.0, found
