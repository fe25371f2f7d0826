"""What trials found, as a table."""
from collections import Counter

FAULTS = ("torn", "lost", "differs", "left", "hangs", "aborts", "wrong")


class Tally:
    """One row a job: how many trials and how many faults of each kind.

    torn     a file under its final name that is not what it should be
    lost     layers that were whole on disk and are planned again, more than were in flight
    differs  the end result is not that of an uninterrupted run
    left     files that stay and belong to no result
    hangs    no end within the limit
    aborts   a signal of its own, std::terminate, or an internal error
    wrong    another exit code, or a message that says nothing
    """

    def __init__(self, title):
        self.title, self.rows, self.examples = title, {}, []

    def row(self, name):
        return self.rows.setdefault(name, Counter())

    def trial(self, name, **counts):
        self.row(name).update(trials=1, **counts)

    def fault(self, name, kind, example):
        assert kind in FAULTS, kind
        self.row(name)[kind] += 1
        if self.row(name)[kind] <= 3:
            self.examples.append(f"{self.title}, {name}: {kind}: {example}")

    def maximum(self, name, column, value):
        self.row(name)[column] = max(self.row(name)[column], value)

    def faults(self):
        return sum(row[kind] for row in self.rows.values() for kind in FAULTS)

    def show(self):
        more = sorted({key for row in self.rows.values() for key in row} - set(FAULTS) - {"trials"})
        columns = ["trials", *more, *FAULTS]
        print(f"\n## {self.title}\n\n| job | " + " | ".join(columns) + " |")
        print("|---|" + "---:|" * len(columns))
        for name, row in self.rows.items():
            print(f"| {name} | " + " | ".join(str(row[column]) for column in columns) + " |")
        total = {column: (max if column.startswith("slowest") else sum)([row[column] for row in self.rows.values()] or [0])
                 for column in columns}
        print("| all | " + " | ".join(str(total[column]) for column in columns) + " |")
        for example in self.examples:
            print("  " + example)
