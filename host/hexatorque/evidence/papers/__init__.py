"""The figures and tables of both papers, reproduced with the firmware. There is one function for
each.

Paper A: Holakooie, Iwanski, Miazga, IEEE Trans. Ind. Electron. 69(10), 2022 (DDR-DTC).
Paper B: Pandit, Aware, Nemade, Levi, IEEE Trans. Power Electron. 32(9), 2017 (DTC1..3).

A figure's function takes a `job.Job` and returns a `figure.Figure`: metrics, verdicts that compare
them with the printed values, recordings and a picture. `reproduce.py` calls the functions and
writes the files.
"""

from __future__ import annotations

from typing import NamedTuple


class Entry(NamedTuple):
    """The title of a figure or table, and the function that makes it: `module.function(job)`. A
    module whose name begins with a dot is in another room of the evidence. rivals: whether it
    depends on the budget of the rivals' search."""

    title: str
    module: str
    function: str
    rivals: bool = False


#: Identifier -> entry, in the order of the papers. "T" marks tables. FSW and REFERENCES are in
#: neither paper (`evidence.methods`).
ENTRIES: dict[str, Entry] = {
    "A1": Entry("Fig. 1 and Table I: voltage vectors in both planes", "both.vectors", "a1"),
    "A-T2": Entry(
        "Table II: virtual vectors of three large ones", "paper_a.virtual_vectors", "a_t2"
    ),
    "A2": Entry("Fig. 2: eight switching sequences of a leg", "paper_a.sequences", "a2"),
    "A3": Entry("Fig. 3: nine forms of the first virtual vector", "paper_a.duties", "a3"),
    "A5": Entry("Fig. 5: dc-link utilisation of the virtual vectors", "paper_a.duties", "a5"),
    "A-T3": Entry("Table III: parameters of the drive", "both.parameters", "a_t3"),
    "A7": Entry("Fig. 7: 100 r/min without load", "paper_a.steady", "a7"),
    "A8": Entry("Fig. 8: 1350 r/min at rated load", "paper_a.steady", "a8"),
    "A9": Entry("Fig. 9: DDR to FDR in flight, 400 r/min without load", "paper_a.inflight", "a9"),
    "A10": Entry(
        "Fig. 10: DDR to FDR in flight, 100 r/min at rated load", "paper_a.inflight", "a10"
    ),
    "A-T4": Entry("Table IV: FDR-DTC and DDR-DTC compared", "paper_a.table4", "a_t4"),
    "A11": Entry(
        "Fig. 11: reversal from +400 to -400 r/min without load", "paper_a.dynamics", "a11"
    ),
    "A12": Entry(
        "Fig. 12: reversal from -400 to +400 r/min at 75 % load", "paper_a.dynamics", "a12"
    ),
    "A13": Entry("Fig. 13: 75 % load step at 400 r/min", "paper_a.dynamics", "a13"),
    "A14": Entry("Fig. 14: rated load taken off at 1350 r/min", "paper_a.dynamics", "a14"),
    "A15": Entry("Fig. 15: switching frequency and THD over speed", "paper_a.sweeps", "a15"),
    "B2": Entry("Fig. 2: voltage vectors in both planes", "both.vectors", "b2"),
    "B-T1": Entry("Table I: switching table of DTC1", "paper_b.tables", "b_t1"),
    "B-T2": Entry("Table II: switching tables of DTC2", "paper_b.tables", "b_t2"),
    "B-T3": Entry(
        "Table III: choice between the two tables by the x-y flux", "paper_b.tables", "b_t3"
    ),
    "B-T4": Entry("Table IV: switching table of DTC3", "paper_b.tables", "b_t4"),
    "B6": Entry("Fig. 6: 24 virtual vectors of DTC3", "paper_b.pairs", "b6"),
    "B7": Entry("Fig. 7: torque slopes of DTC1 at 500 and 2500 r/min", "paper_b.slopes", "b7"),
    "B-T5": Entry("Table V: parameters of the machine", "both.parameters", "b_t5"),
    "B10": Entry("Fig. 10: stator flux loci, DTC1", "paper_b.loci", "b10"),
    "B11": Entry("Fig. 11: stator flux loci, DTC2", "paper_b.loci", "b11"),
    "B12": Entry("Fig. 12: stator flux loci, DTC3", "paper_b.loci", "b12"),
    "B13": Entry("Fig. 13: phase currents and spectra", "paper_b.steady", "b13"),
    "B14": Entry("Fig. 14: THD over load", "paper_b.sweeps", "b14"),
    "B15": Entry("Fig. 15: torque in steady state", "paper_b.steady", "b15"),
    "B16": Entry("Fig. 16: torque ripple over speed", "paper_b.ripple", "b16"),
    "B17": Entry("Fig. 17: speed step from 1000 to 2000 r/min", "paper_b.dynamics", "b17"),
    "B18": Entry("Fig. 18: load step from 0.3 to 2 N m at 2000 r/min", "paper_b.dynamics", "b18"),
    "B19": Entry("Fig. 19: switching frequency over load", "paper_b.sweeps", "b19"),
    "B-T6": Entry("Table VI: DTC1, DTC2 and DTC3 compared", "paper_b.table", "b_t6"),
    "FSW": Entry("All schemes at equal switching frequency", ".methods.fsw", "fsw"),
    "REFERENCES": Entry(
        "All schemes and what an expert would use instead, on four machines",
        ".methods.references",
        "references",
        rivals=True,
    ),
}
