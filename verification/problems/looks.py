"""Does the preset ``sketch``, with which `repro check` looks at a scene, judge pores as ``fast`` does?

    python -m verification.problems.looks 17 18     # these members; all of them without numbers

Two looks agree if both name the same end, and if the first contacts are at most 5 % apart. Each look has a limit of
processor time.
"""

import json
import sys
from time import process_time

from repro.errors import RunEnd, SimulationError, StageError
from repro.march.simulation import steps
from repro.preflight.outlook import sketched
from repro.scene import Scene
from verification.problems import family
from verification.problems.hard import TooLong, limited

#: Largest relative difference of two times of contact.
CONTACTS = 0.05
#: Processor time (s) of one look.
LIMIT = 60.0


def look(scene: Scene) -> dict:
    """End, time of contact (h; None without contact) and processor time (s) of a run."""
    start, contact, end = process_time(), None, "end"
    try:
        with limited(LIMIT):
            for state, _ in steps(scene):
                if contact is None and state.pore.contact:
                    contact = state.pore.time
    except RunEnd as error:
        end = type(error).__name__
    except (SimulationError, StageError, TooLong) as error:
        end = f"failed: {error}"
    return {"end": end, "contact_h": contact, "cpu_s": round(process_time() - start, 2)}


def agree(sketch: dict, fast: dict) -> bool:
    """Do two looks name the same end, and nearly the same time of contact?"""
    contact, expected = sketch["contact_h"], fast["contact_h"]
    near = contact == expected if None in (contact, expected) else abs(contact / expected - 1) <= CONTACTS
    return near and sketch["end"] == fast["end"]


def main(numbers: list[int]) -> None:
    """Print a row for each member, and the number of members on which both looks agree."""
    rows = []
    for number in numbers or range(family.MEMBERS):
        member = family.draw_member(number)
        scene = member.scene(*member.duration)
        looks = {"sketch": look(sketched(scene)), "fast": look(scene)}
        rows.append({"number": number, "agree": agree(**looks), **looks})
        print(json.dumps(rows[-1]), flush=True)
    print(f"{sum(row['agree'] for row in rows)} of {len(rows)} agree")


if __name__ == "__main__":
    main([int(text) for text in sys.argv[1:]])
