"""AIS_VESSEL, as ArduPilot forwards it, back into the sentences that its receiver heard.

So there is one way in for AIS, and one form in a recording. Nothing is lost: ArduPilot's numbers
are those of the sentences, only in other units.
"""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.mavlink import Message

KNOT_CMPS = 185_200.0 / 3600.0
"""[cm/s]"""


def ais_sentences(message: Message) -> list[tuple[float, str]]:
    """Write an AIS_VESSEL as sentences.

    Parameters
    ----------
    message
        An AIS_VESSEL.

    Returns
    -------
    sentences : list of (age, sentence)
        How old the report was when it was forwarded [s]; a position report, and name and
        dimensions where these are known. Empty where the message holds no MMSI or position.
    """
    from pyais import encode_dict

    flags, mmsi = message.flags, message.MMSI
    if not 0 < mmsi <= 999_999_999 or not (message.lat or message.lon):
        return []
    speed_kn = message.velocity / KNOT_CMPS if flags & mavlink.AIS_FLAGS_VALID_VELOCITY else 102.3
    course_deg = message.COG / 100.0 if flags & mavlink.AIS_FLAGS_VALID_COG else 360.0
    heading = round(message.heading / 100.0) % 360 if message.heading < 36_000 else 511
    fields = [
        {
            "type": 1,
            "mmsi": mmsi,
            "lat": message.lat * 1e-7,
            "lon": message.lon * 1e-7,
            "speed": min(speed_kn, 102.3),
            "course": min(course_deg, 360.0),
            "heading": heading,
            "accuracy": bool(flags & mavlink.AIS_FLAGS_POSITION_ACCURACY),
            "status": min(message.navigational_status, 15),
            "second": 60,
        }
    ]
    sized = bool(flags & mavlink.AIS_FLAGS_VALID_DIMENSIONS)
    if sized or flags & mavlink.AIS_FLAGS_VALID_NAME:
        fields.append(
            {
                "type": 5,
                "mmsi": mmsi,
                "shipname": _text(message.name, 20),
                "callsign": _text(message.callsign, 7),
                "ship_type": min(message.type, 99),
                "to_bow": min(message.dimension_bow, 511) if sized else 0,
                "to_stern": min(message.dimension_stern, 511) if sized else 0,
                "to_port": min(message.dimension_port, 63) if sized else 0,
                "to_starboard": min(message.dimension_starboard, 63) if sized else 0,
            }
        )
    age_s = float(message.tslc) if math.isfinite(message.tslc) else 0.0
    return [
        (age_s, line)
        for each in fields
        for line in encode_dict(each, talker_id="AI", sentence_type="VDM", seq_id=mmsi % 10)
    ]


def _text(value: str, longest: int) -> str:
    """Give text in AIS's six bits: capitals, digits and signs."""
    return "".join(c if " " <= c <= "_" else " " for c in value.upper())[:longest].strip()
