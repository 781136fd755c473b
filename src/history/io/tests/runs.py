"""Computes the figures of control runs from stored samples, and compares them with those of the program."""
import csv, datetime, json, sys

BAND, STEADY_FOR, GAP_MAX = 0.5, 300.0, 10.0

# Each sample holds until the next one of its tag; None where it is not good.
changes = {}
for row in csv.DictReader(open(sys.argv[1])):
    value = float(row["value"]) if row["quality"] == "true" else None
    changes.setdefault(float(row["second"]), {})[row["tag"]] = value
runs = json.load(open(sys.argv[2]))


def instant(text):
    return datetime.datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()


def compute(begin, end, sv, ended):
    """At SV, steady, rise, overshoot, offset, IAE in unit minutes, share of good time."""
    times = [time for time in sorted(changes) if time <= end]
    held = {"TIC-1.SV": None, "TIC-1.PV": None}
    error = start = in_band = since = toward = at_sv = offset = None
    gap_from, over, area, good, passed, last = begin, None, 0.0, 0.0, [None, None], begin
    # Every second counts: what holds grows old without a change.
    seconds = sorted({time for time in times if begin <= time} | {begin + n for n in range(int(end - begin) + 1)})
    for time in times:
        if time < begin:
            held.update(changes[time])
    for time in seconds:
        held.update(changes.get(time, {}))
        if error is not None:
            area += abs(error) * (time - last) / 60.0
            good += time - last
        last = time
        pv = held["TIC-1.PV"] if held["TIC-1.SV"] == sv else None
        if time == end and ended:
            # The change that ends a run belongs to the next one.
            break
        if pv is None:
            error = None
            gap_from = time if gap_from is None else gap_from
            if time - gap_from > GAP_MAX:
                in_band = since = offset = None
            continue
        gap = gap_from is not None and time - gap_from > GAP_MAX
        gap_from, error, offset = None, sv - pv, sv - pv
        if start is None:
            start = pv
        now = "unknown" if gap else time - begin
        inside = abs(error) <= BAND
        if toward is None and not inside:
            toward, at_sv = (1 if error > 0 else -1), None
        beyond = 0.0 if toward is None else -error * toward
        if at_sv is None and (inside or beyond > 0):
            at_sv = now
        if abs(sv - start) > BAND:
            way = (pv - start) / (sv - start)
            passed = [now if mark is None and way >= part else mark for mark, part in zip(passed, (0.1, 0.9))]
        over = max(over or 0.0, beyond)
        # Seen at SV since, and when it came there: unknown after a gap.
        in_band = ((time, now) if in_band is None or gap else in_band) if inside else None
        since = in_band[1] if in_band is not None and time - in_band[0] >= STEADY_FOR else None
    rise = None
    if passed[1] is not None:
        rise = "unknown" if "unknown" in passed else passed[1] - passed[0]
    return at_sv, since, rise, over, offset, area, good / (end - begin)


def figure(value):
    if value == "NotYet":
        return None
    if value == "Unknown":
        return "unknown"
    return value["After"]["secs"] + value["After"]["nanos"] / 1e9


wrong = []
for run in runs:
    begin, end = instant(run["from"]), instant(run["until"])
    expect = compute(begin, end, run["sv"], run["state"] == "Ended")
    found = (figure(run["at_sv"]), figure(run["steady"]), figure(run["rise"]), run["overshoot"], run["offset"], run["iae"], run["good"])
    names = ("at SV", "steady", "rise", "overshoot", "offset", "IAE", "good")
    for name, one, other in zip(names, found, expect):
        same = one == other or isinstance(one, float) and isinstance(other, (int, float)) and abs(one - other) < 1e-6
        if not same:
            wrong.append(f"run {run['number']} {run['state']} SV {run['sv']} {begin:.0f}..{end:.0f} {name}: {one}, computed {other}")
if wrong:
    sys.exit("\n".join(wrong))
print(len(runs), "runs")
