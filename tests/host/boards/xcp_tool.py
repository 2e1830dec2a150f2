"""What a calibration tool does by pyXCP, in a process of its own: pyXCP ends the process that it
runs in when a packet has a length that it does not expect.

    python xcp_tool.py WHAT LAYER ...      WHAT: calibrate or measure
    ... eth PROTOCOL PORT                  PROTOCOL: TCP or UDP
    ... sxi PORT BAUD

Prints JSON. Addresses come in by the file addresses.json in the working directory, and the
measurement goes into measured.csv there.
"""

import json
import struct
import sys
import time
from pathlib import Path

from pyxcp.cmdline import ArgumentParser
from pyxcp.daq_stim import DaqList, DaqToCsv
from pyxcp.types import XcpResponseError

ETH = """
c = get_config()
c.Transport.layer = "ETH"
c.Transport.Eth.protocol = "{}"
c.Transport.Eth.host = "127.0.0.1"
c.Transport.Eth.port = {}
"""
SXI = """
c = get_config()
c.Transport.layer = "SXI"
c.Transport.SxI.port = "{}"
c.Transport.SxI.bitrate = {}
c.Transport.SxI.header_format = "HEADER_LEN_CTR_WORD"
c.Transport.SxI.tail_format = "CHECKSUM_WORD"
"""
#: Otherwise pyXCP repeats a refused command for ever. On a serial port it takes at most 9 s.
BOTH = "c.General.disable_error_handling = True\nc.Transport.timeout = 9.0\n"
STORE_CAL = 1
#: An emulated board may be slower than the clock.
SAMPLES, LONGEST_S = 1000, 60.0


class Counting(DaqToCsv):
    count = 0

    def on_daq_list(self, *sample):
        self.count += 1
        super().on_daq_list(*sample)


def refused(command, *arguments):
    try:
        command(*arguments)
    except XcpResponseError as error:
        return str(error.get_error_code())
    return "done"


def calibrate(x, at):
    def get(address):
        return struct.unpack("<f", x.shortUpload(4, address))[0]

    def put(address, value):
        x.setMta(address)
        return refused(x.download, struct.pack("<f", value))

    found = {"name": x.identifier(0), "before": get(at["speed_ref_rpm"])}
    found["written"] = put(at["speed_ref_rpm"], 123.5)
    found["after"] = get(at["speed_ref_rpm"])
    found["too large"] = put(at["speed_ref_rpm"], 1e9)
    found["no whole number"] = put(at["pole_pairs"], 2.5)
    found["a channel"] = put(at["vdc_V"], 1.0)
    found["no address"] = put(0x9000, 1.0)
    found["read of no address"] = refused(x.shortUpload, 4, 0x9000)
    found["still"] = get(at["speed_ref_rpm"])
    found["vdc_V"] = get(at["vdc_V"])
    found["initial"] = get(at["kp_speed_Nms_rad"])
    put(at["kp_speed_Nms_rad"], 0.75)
    x.setCalPage(0x02, 0, 1)
    found["kept"] = get(at["speed_ref_rpm"])
    found["store"] = refused(x.setRequest, STORE_CAL, 0)  # it writes before it answers
    x.setCalPage(0x02, 0, 1)  # the page is read when it is chosen
    found["stored"] = get(at["kp_speed_Nms_rad"])
    x.setCalPage(0x83, 0, 0)
    return found


def too_much(x, at):
    """More at 10 kHz than any line here carries."""
    x.freeDaq()
    x.allocDaq(4)
    for k in range(4):
        x.allocOdt(k, 1)
    for k in range(4):
        x.allocOdtEntry(k, 0, 32)
    for k in range(4):
        x.setDaqPtr(k, 0, 0)
        for _ in range(32):
            x.writeDaq(0xFF, 4, 0, at["vdc_V"])
        x.setDaqListMode(0x10, k, 0, 1, 0)
        x.startStopDaqList(2, k)
    return refused(x.startStopSynch, 1)


def main():
    what, layer, *where = sys.argv[1:]
    at = json.loads(Path("addresses.json").read_text())
    Path("pyxcp_conf.py").write_text((ETH if layer == "eth" else SXI).format(*where) + BOTH)
    sys.argv[1:] = ["-c", "pyxcp_conf.py"]
    names = at.pop("measured", [])
    prescaler, event = at.pop("prescaler", 1), at.pop("event", 0)
    lists = [
        DaqList(
            name="measured", event_num=event, stim=False, enable_timestamps=True,
            measurements=[(name, at[name], 0, "F32") for name in names], priority=0,
            prescaler=prescaler,
        )
    ]  # fmt: skip
    policy = Counting(lists) if what == "measure" else None
    with ArgumentParser(description="").run(policy=policy) as x:
        x.connect()
        if what == "calibrate":
            found = calibrate(x, at)
            found["too much"] = too_much(x, at)
        else:
            policy.setup()
            policy.start()
            end = time.monotonic() + LONGEST_S
            while policy.count < SAMPLES and time.monotonic() < end:
                time.sleep(0.05)
            policy.stop()
            found = {}
        x.disconnect()
    print(json.dumps(found))


if __name__ == "__main__":
    main()
