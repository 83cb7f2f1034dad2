"""The viewer's port; whom it answers is tested in test_server.py."""

import pytest

from twinscrew.hil_sim.viewer.server import listen
from twinscrew.runtime.errors import ConfigError


def test_a_port_in_use_is_refused_in_words():
    with listen(0) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ConfigError, match=f"--port: port {port} is in use"):
            listen(port)


def test_only_this_machine_is_listened_to():
    with listen(0) as taken:
        assert taken.getsockname()[0] == "127.0.0.1"
