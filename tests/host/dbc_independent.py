"""Decodes random frames by the DBC with canmatrix, a parser that is not ours, and compares with `tribend decode --json`; packs
what it decoded again, which must be the same message.

Usage: dbc_independent.py DBC TRIBEND COUNT; prints what differs, exit 0 when nothing does."""
import json
import math
import random
import subprocess
import sys

import canmatrix
import canmatrix.formats


def named(signal, raw, value):
    """What `tribend decode` calls this value of a signal with names, bits or a note of what means no value."""
    comment = signal.comment or ""
    if "raw " in comment and ": no value" in comment:
        if raw == int(comment.split("raw ")[1].split(":")[0]):
            return None
    if "bits: " in comment:
        names = {int(bit.split()[0]): bit.split()[1] for bit in comment.split("bits: ")[1].split(", ")}
        return [names.get(bit, bit) for bit in range(64) if raw >> bit & 1]
    if raw in signal.values:
        return signal.values[raw]
    if isinstance(value, str):
        return value
    return float(value)


def main(dbc, tribend, count):
    matrices = canmatrix.formats.loadp(dbc)
    matrix = list(matrices.values())[0]
    if matrix.load_errors:
        print("canmatrix warns of", matrix.load_errors)
        return 1
    random.seed(1)
    frames = [(frame, bytes(random.getrandbits(8) for _ in range(frame.size)))
              for frame in (random.choice(matrix.frames) for _ in range(count))]
    lines = ["%03X#%s%s" % (frame.arbitration_id.id, "#0" if frame.is_fd else "", data.hex().upper())
             for frame, data in frames]
    ours = subprocess.run([tribend, "decode", "--json"], input="\n".join(lines) + "\n", capture_output=True, text=True,
                          check=True).stdout.splitlines()
    if len(ours) != count:
        print("decoded", len(ours), "of", count)
        return 1
    wrong = signals = 0
    for (frame, data), line in zip(frames, ours):
        fields = json.loads(line)["fields"]
        decoded = frame.decode(data)
        if set(fields) != set(decoded):
            print(frame.name, "has fields", sorted(fields), "and signals", sorted(decoded))
            wrong += 1
            continue
        again = frame.decode(frame.encode({name: signal.signal.phys2raw(signal.phys_value) for name, signal in decoded.items()}))
        for name, signal in decoded.items():
            if again[name].raw_value != signal.raw_value:
                print(frame.name, name, "raw", signal.raw_value, "comes back as", again[name].raw_value)
                wrong += 1
            theirs, mine = named(signal.signal, signal.raw_value, signal.phys_value), fields[name]
            signals += 1
            if isinstance(mine, str) and mine.startswith("0x"):
                same = signal.raw_value == int(mine, 16)
            elif isinstance(theirs, float) and isinstance(mine, (int, float)):
                same = math.isclose(theirs, float(mine), rel_tol=1e-9, abs_tol=1e-12)
            else:
                same = theirs == mine
            if not same:
                print(frame.name, name, "by canmatrix", theirs, "by tribend", mine)
                wrong += 1
    print(count, "messages,", signals, "signals,", wrong, "differ")
    return 1 if wrong or len({frame.name for frame, _ in frames}) != len(matrix.frames) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], int(sys.argv[3])))
