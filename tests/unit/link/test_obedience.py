from twinscrew.runtime.link.ardupilot.listener import Obedience

STOP = 1500


def watch(commands, outputs, *, period_s=0.05, seconds=3.0, heartbeats=True):
    """Run both functions of time side by side at 20 Hz; gives the verdict.

    Every second a heartbeat says that we drive.
    """
    obedience = Obedience(tolerance_us=5, delay_s=0.5, patience_s=0.5)
    for k in range(round(seconds / period_s)):
        now_s = k * period_s
        obedience.commanded(commands(now_s), now_s)
        obedience.measured(outputs(now_s), STOP, now_s)
        if heartbeats and k % 20 == 0:
            obedience.confirmed(now_s)
    return obedience.obeying


def ramp(now_s):
    return (1500 + round(100 * now_s), 1500 - round(50 * now_s))


def stop(now_s):
    return (STOP, STOP)


def test_outputs_that_follow_obey():
    assert watch(ramp, ramp) is True


def test_outputs_that_follow_late_and_roughly_still_obey():
    assert watch(ramp, lambda t: tuple(v + 1 for v in ramp(max(0.0, t - 0.4)))) is True


def test_outputs_that_stay_at_stop_disobey():
    assert watch(ramp, stop) is False


def test_before_a_heartbeat_says_that_we_still_drive_a_pilot_may_have_the_boat():
    assert watch(ramp, stop, heartbeats=False) is None


def test_one_propeller_that_does_not_follow_is_enough():
    assert watch(ramp, lambda t: (ramp(t)[0], STOP)) is False


def test_swapped_propellers_disobey():
    assert watch(ramp, lambda t: ramp(t)[::-1]) is False


def test_at_stop_nobody_can_tell():
    assert watch(stop, stop) is None


def test_a_short_difference_is_forgiven():
    assert watch(ramp, lambda t: stop(t) if 2.0 <= t < 2.4 else ramp(t)) is True


def test_obeying_again_is_noticed():
    assert watch(ramp, lambda t: stop(t) if 1.0 <= t < 2.2 else ramp(t)) is True


def test_outputs_that_run_on_after_a_stop_command_disobey():
    assert (
        watch(lambda t: (1700, 1700) if t < 1.0 else (STOP, STOP), lambda t: (1700, 1700)) is False
    )


def test_memory_stays_bounded():
    obedience = Obedience(tolerance_us=5, delay_s=0.5, patience_s=0.5)
    for k in range(10_000):
        obedience.commanded((1500, 1500), k * 0.05)
    assert len(obedience._commands) < 20
