"""Reads a report in every format and compares its figures with those of the samples."""
import csv, datetime, glob, html.parser, json, subprocess, sys

import docx, openpyxl, pyarrow.parquet

folder, samples, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3])
HOLD = 150.0


def the(ending):
    [path] = [path for path in glob.glob(f"{folder}/*{ending}") if ".record." not in path]
    return path


# A sample stands until the next one, and at most for HOLD; only good ones count.
figures = {}
rows = list(csv.DictReader(open(samples)))
for tag in ("TIC-1.PV", "PLC-1.HEATER.KWH"):
    own = [(float(r["second"]), float(r["value"]) if r["value"] else None) for r in rows if r["tag"] == tag]
    held, last, counted = [], None, 0.0
    for (at, value), (after, _) in zip(own, own[1:] + [(seconds, None)]):
        if value is None or at >= seconds:
            continue
        # What is between two readings belongs to the later one, and one on an edge to the period that begins.
        if last is not None and at >= 0:
            counted += value if 0 <= value < last / 2 else value - last
        last = value
        begin, end = max(at, 0.0), min(after, at + HOLD, seconds)
        if begin < end:
            held.append((value, end - begin))
    last = held[-1][0]
    time = sum(span for _, span in held)
    values = [value for value, _ in held]
    mean = sum(value * span for value, span in held) / time
    figures[tag] = (values[0], min(values), mean, max(values), last, counted, 100 * time / seconds)

# CSV: strict, equally wide, the columns in their order; the header may be in any language.
table = list(csv.reader(open(the(".csv"), newline="", encoding="utf-8"), strict=True))
assert len({len(row) for row in table}) == 1, "rows of different lengths"
lines = {row[0]: row for row in table if row[0] in figures and row[1] in ("°C", "kWh")}
assert set(lines) == set(figures), lines.keys()
for tag, (first, low, mean, high, last, counted, good) in figures.items():
    row = lines[tag]
    counter = tag.endswith("KWH")
    expected = [first, low, None if counter else mean, high, last, counted if counter else None]
    for found, wanted in zip(row[2:8], expected):
        if wanted is None:
            assert found == "", (tag, row)
        else:
            step = 10.0 ** -len(found.partition(".")[2])
            assert abs(float(found) - wanted) <= step * 0.51 + 1e-9, (tag, found, wanted)
    assert abs(float(row[9]) - good) <= 0.11, (row, good)
assert not any(cell[:1] in "=+@" and cell for row in table for cell in row), "a cell that runs"

# JSON has the same figures.
values = {row["tag"]: row for row in json.load(open(the(".json")))["values"]}
names = ["first", "min", "mean", "max", "last", "difference", "minutes in alarm", "good %"]
for tag, row in lines.items():
    for name, cell in zip(names, row[2:10]):
        found = values[tag][name]
        assert (found is None) if cell == "" else abs(found - float(cell)) < 1e-9, (tag, name, found, cell)

# Parquet has the same figures under the same names, its numbers are numbers, and its period and provenance stand in the file.
file = pyarrow.parquet.ParquetFile(the(".parquet"))
values = {row["tag"]: row for row in file.read().to_pylist()}
for tag, row in lines.items():
    for name, cell in zip(names, row[2:10]):
        found = values[tag][name]
        assert (found is None) if cell == "" else abs(found - float(cell)) < 1e-9, (tag, name, found, cell)
keys = file.metadata.metadata
begin, end = (datetime.datetime.fromisoformat(keys[key].decode()) for key in (b"from", b"to"))
assert (end - begin).total_seconds() == seconds and keys[b"program"].startswith(b"sightglass "), keys

# XLSX: numbers are numbers, dates are dates, nothing is a formula; what a cell shows is what the CSV has.
book = openpyxl.load_workbook(the(".xlsx"))
assert not any(cell.data_type == "f" for sheet in book for row in sheet.iter_rows() for cell in row), "a formula"
found = {row[0].value: row for sheet in book for row in sheet.iter_rows() if row[0].value in figures and row[1].value in ("°C", "kWh")}
for tag, row in lines.items():
    for cell, text in zip(found[tag][2:10], row[2:10]):
        assert (cell.value is None) if text == "" else abs(cell.value - float(text)) < 1e-9, (tag, cell.value, text)
        if text:
            decimals = len(text.partition(".")[2])
            assert cell.number_format in ("0." + "0" * decimals, "0"), cell.number_format
dates = [cell for sheet in book for row in sheet.iter_rows() for cell in row if cell.is_date]
assert len(dates) > 100 and all(isinstance(cell.value, datetime.datetime) for cell in dates)
texts = {cell.value for sheet in book for row in sheet.iter_rows() for cell in row}
assert {"=1+2", "@anna", "+temperature high"} <= texts
assert sum(len(sheet._charts) for sheet in book) >= 1


# HTML and DOCX: every cell of the row of a tag.
class Rows(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.rows, self.cell = [], None

    def handle_starttag(self, tag, _):
        assert tag != "script"
        if tag == "tr":
            self.rows.append([])
        if tag == "td":
            self.cell = ""

    def handle_endtag(self, tag):
        if tag == "td":
            self.rows[-1].append(self.cell)
            self.cell = None

    def handle_data(self, data):
        if self.cell is not None:
            self.cell += data


page = Rows()
page.feed(open(the(".html"), encoding="utf-8").read())
word = [[cell.text for cell in row.cells] for table in docx.Document(the(".docx")).tables for row in table.rows]
text = [line.split() for line in open(the(".txt"), encoding="utf-8")]
printed = subprocess.run(["pdftotext", "-layout", the(".pdf"), "-"], capture_output=True, text=True, check=True).stdout
pages = [line.split() for line in printed.splitlines()]
# The label of a tag stands beside its name.
for rows in (page.rows, word):
    for tag, row in lines.items():
        assert any(other and other[0] == f"{tag} {row[10]}" for other in rows), (tag, row)
for rows in (page.rows, word, text, pages):
    for tag, row in lines.items():
        unit = row[1]
        [of_tag] = [other for other in rows if other and other[0].split()[:1] == [tag] and unit in other and len(other) > 6]
        shown = [cell for cell in of_tag[of_tag.index(unit) + 1 :] if cell not in ("", "–")]
        assert shown == [cell for cell in row[2:10] if cell], (tag, of_tag, row)
print("figures agree:", sum(len(row) for row in lines.values()), "cells in eight formats")
