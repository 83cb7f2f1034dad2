"""Long work says how far it is in a log, and does not fill the log."""

from twinscrew.runtime.progress import EVERY_S, ProgressLines


def test_lines_come_at_once_now_and_then_and_at_the_end() -> None:
    told: list[str] = []
    now_s = [0.0]
    lines = ProgressLines("episodes", told.append, lambda: now_s[0])
    for done in range(101):
        lines.update(done, 100)
        now_s[0] += 0.3 * EVERY_S
    lines.update(100, 100)
    assert told[0] == "episodes: 0 of 100"
    assert told[-1] == "episodes: 100 of 100"
    assert len(told) == len(set(told))
    assert 20 < len(told) < 40
