"""What the tool makes of a study's tables: short ones stand on the page, long ones are data."""

import doc_page
import write_studies

SHORT = ("What was found", ["who", "how many"], [["a", "1"]])
LONG = [
    (f"At {n} r/min", ["error", "ripple"], [[f"e{k}", f"{n}"] for k in range(9)]) for n in (1, 2)
]


def test_each_row_is_in_one_place(tmp_path):
    page = tmp_path / "page.md"
    text = write_studies.markdown([SHORT, *LONG], page, "study")
    assert "What was found:\n\n| who | how many |" in text and "| a | 1 |" in text
    assert "e1" not in text and text.count("](data/") == 1
    heads, *rows = doc_page.read_data(page, "study")
    assert heads == ["table", "error", "ripple"]
    assert rows == [[title, *row] for title, _, of in LONG for row in of]


def test_tables_with_other_columns_are_other_files(tmp_path):
    other = ("Wrong wiring: all", ["set-up"], [[f"{k}"] for k in range(9)])
    text = write_studies.markdown([LONG[0], other], tmp_path / "page.md", "study")
    assert "- [At 1 r/min](data/study-at-1-r-min.csv)" in text
    assert "- [Wrong wiring: all](data/study-wrong-wiring.csv)" in text
    assert len(doc_page.read_data(tmp_path / "page.md", "study-wrong-wiring")) == 10
