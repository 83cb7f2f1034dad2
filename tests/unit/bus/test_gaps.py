from zenoh.ext import Int64, z_serialize

from twinscrew.runtime.bus.base import ATTACHMENT, MAX_PUBLISHERS, SequenceGaps, attachment

GID = bytes(range(16))


def test_the_attachment_is_rmw_zenohs_33_bytes():
    theirs = z_serialize((Int64(7), Int64(123_456_789), GID)).to_bytes()
    assert attachment(7, 123_456_789, GID) == theirs
    assert len(theirs) == ATTACHMENT.size == 33


def test_missing_numbers_are_counted_for_each_topic():
    gaps = SequenceGaps()
    for sequence in (1, 2, 5, 6, 9):
        gaps.see("points", attachment(sequence, 0, GID))
    gaps.see("odometry", attachment(1, 0, GID))
    assert gaps.lost == {"points": 4}


def test_two_senders_do_not_look_like_a_gap():
    gaps = SequenceGaps()
    for sequence in (1, 2, 3):
        gaps.see("points", attachment(sequence, 0, GID))
        gaps.see("points", attachment(100 + sequence, 0, GID[::-1]))
    assert gaps.lost == {}


def test_a_sender_that_was_there_before_us_or_began_anew_has_lost_nothing():
    gaps = SequenceGaps()
    for sequence in (500, 501, 1, 2):
        gaps.see("points", attachment(sequence, 0, GID))
    assert gaps.lost == {}


def test_an_absurd_number_is_no_loss_and_later_losses_are_counted():
    gaps = SequenceGaps()
    for sequence in (1, 2, 2**62, 3, 6):
        gaps.see("points", attachment(sequence, 0, GID))
    assert gaps.lost == {"points": 2}


def test_an_attachment_of_another_kind_says_nothing():
    gaps = SequenceGaps()
    gaps.see("points", b"hello")
    assert gaps.lost == {}


def test_inventing_senders_does_not_fill_the_memory():
    gaps = SequenceGaps()
    for number in range(2 * MAX_PUBLISHERS):
        gaps.see("points", attachment(1, 0, number.to_bytes(16, "little")))
    assert len(gaps._last) == MAX_PUBLISHERS
