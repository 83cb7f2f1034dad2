"""The paper's settings."""

from twinscrew.training.settings_table import published_distance_m


def test_the_published_distance_grows_with_the_number_of_vessels() -> None:
    assert [published_distance_m(n) for n in (1, 3, 4, 5, 8)] == [30, 30, 35, 40, 40]
