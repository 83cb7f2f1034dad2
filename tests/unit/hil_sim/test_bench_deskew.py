from twinscrew.hil_sim.bench.deskew import run_deskew


def test_deskewing_takes_most_of_the_turns_error_out() -> None:
    figures = run_deskew(scenes=8)
    assert figures["objects"] > 10
    assert figures["skewed_p50_m"] > 0.3
    assert figures["deskewed_p50_m"] < 0.2 * figures["skewed_p50_m"]
