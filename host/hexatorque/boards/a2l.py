"""The firmware's tables of parameters and channels as an A2L file (ASAM MCD-2 MC 1.7.1), for tools
that speak XCP (docs/xcp.md)."""

from __future__ import annotations

from collections.abc import Iterable

from .. import __version__, firmware
from ..firmware import STATES, lib

#: Rate of a serial port, that of an image for the F28377S.
BAUD = 1_250_000
#: Largest number that a float has: the range of a channel is not known.
ANY = 3.4028235e38
#: The longest time that a slave needs for an answer, ms: it may write its flash.
ANSWER_MS = 12000

#: The parts of XCP's own description that this file has, as A2L describes them.
A2ML = """
  block "IF_DATA" taggedunion if_data {
    "XCP" struct {
      taggedstruct {
        block "PROTOCOL_LAYER" struct {
          uint; uint; uint; uint; uint; uint; uint; uint; uchar; uint;
          enum { "BYTE_ORDER_MSB_LAST" = 0, "BYTE_ORDER_MSB_FIRST" = 1 };
          enum { "ADDRESS_GRANULARITY_BYTE" = 1, "ADDRESS_GRANULARITY_WORD" = 2 };
          taggedstruct { ("OPTIONAL_CMD" char[64])*; };
        };
        block "DAQ" struct {
          enum { "STATIC" = 0, "DYNAMIC" = 1 };
          uint; uint; uchar;
          enum { "OPTIMISATION_TYPE_DEFAULT" = 0 };
          enum { "ADDRESS_EXTENSION_FREE" = 0 };
          enum { "IDENTIFICATION_FIELD_TYPE_ABSOLUTE" = 0 };
          enum { "GRANULARITY_ODT_ENTRY_SIZE_DAQ_DWORD" = 4 };
          uchar;
          enum { "NO_OVERLOAD_INDICATION" = 0, "OVERLOAD_INDICATION_EVENT" = 2 };
          taggedstruct {
            "PRESCALER_SUPPORTED";
            block "TIMESTAMP_SUPPORTED" struct {
              uint;
              enum { "SIZE_DWORD" = 4 };
              enum { "UNIT_1US" = 3 };
              taggedstruct { "TIMESTAMP_FIXED"; };
            };
            (block "EVENT" struct {
              char[101]; char[9]; uint;
              enum { "DAQ" = 1 };
              uchar; uchar; uchar; uchar;
            })*;
          };
        };
        block "PAG" struct { uchar; };
        block "SEGMENT" struct {
          uchar; uchar; uchar; uchar; uchar;
          taggedstruct {
            (block "PAGE" struct {
              uchar;
              enum { "ECU_ACCESS_NOT_ALLOWED" = 0, "ECU_ACCESS_DONT_CARE" = 3 };
              enum { "XCP_READ_ACCESS_DONT_CARE" = 3 };
              enum { "XCP_WRITE_ACCESS_NOT_ALLOWED" = 0, "XCP_WRITE_ACCESS_DONT_CARE" = 3 };
            })*;
          };
        };
        block "XCP_ON_TCP_IP" struct { uint; uint; taggedunion { "ADDRESS" char[15]; }; };
        block "XCP_ON_UDP_IP" struct { uint; uint; taggedunion { "ADDRESS" char[15]; }; };
        block "XCP_ON_SxI" struct {
          uint; ulong;
          taggedstruct {
            block "ASYNCH_FULL_DUPLEX_MODE" struct {
              enum { "PARITY_NONE" = 0 };
              enum { "ONE_STOP_BIT" = 1 };
            };
          };
          enum { "HEADER_LEN_CTR_WORD" = 4 };
          enum { "CHECKSUM_WORD" = 2 };
        };
      };
    };
  };
"""
#: Optional commands of XCP that the slave has (firmware/link/xcp/ht_xcp_codes.h).
OPTIONAL = (
    "GET_COMM_MODE_INFO", "GET_ID", "SET_REQUEST", "SET_MTA", "UPLOAD", "SHORT_UPLOAD",
    "BUILD_CHECKSUM", "USER_CMD", "DOWNLOAD", "SET_CAL_PAGE", "GET_CAL_PAGE",
    "GET_PAG_PROCESSOR_INFO", "GET_SEGMENT_INFO", "GET_PAGE_INFO", "CLEAR_DAQ_LIST", "SET_DAQ_PTR",
    "WRITE_DAQ", "SET_DAQ_LIST_MODE", "GET_DAQ_LIST_MODE", "START_STOP_DAQ_LIST",
    "START_STOP_SYNCH", "GET_DAQ_CLOCK", "READ_DAQ", "GET_DAQ_PROCESSOR_INFO",
    "GET_DAQ_RESOLUTION_INFO", "GET_DAQ_EVENT_INFO", "FREE_DAQ", "ALLOC_DAQ", "ALLOC_ODT",
    "ALLOC_ODT_ENTRY",
)  # fmt: skip


def quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def parameter_name(name: str) -> str:
    """A parameter as everywhere in the project: a channel may have its plain name."""
    return f"controller.{name}"


def _address(begin: int, row: int) -> str:
    return f"0x{begin + lib.HT_NUMBER_XCP_VALUE * row:X}"


def _choices(name: str, texts: Iterable[str]) -> list[str]:
    """A conversion of whole numbers to words."""
    texts = list(texts)
    words = [f"      {k} {quoted(text)}" for k, text in enumerate(texts)]
    return [
        f'    /begin COMPU_METHOD {name} "" TAB_VERB "%1.0" ""',
        f"      COMPU_TAB_REF {name}.words",
        "    /end COMPU_METHOD",
        f'    /begin COMPU_VTAB {name}.words "" TAB_VERB {len(texts)}',
        *words,
        "    /end COMPU_VTAB",
    ]


def _parameters() -> list[str]:
    lines = []
    for row in firmware.parameters().values():
        name = parameter_name(row.name)
        method = f"words.{row.name}" if row.choices else "NO_COMPU_METHOD"
        if row.choices:
            lines += _choices(method, row.choices)
        address = _address(lib.HT_NUMBER_XCP_PARAMETERS_AT, row.id)
        lines += [
            f"    /begin CHARACTERISTIC {name} {quoted(row.help)}",
            f"      VALUE {address} value 0 {method} {row.min!r} {row.max!r}",
            *([f"      PHYS_UNIT {quoted(row.unit)}"] if row.unit else []),
            *(["      STEP_SIZE 1"] if row.whole else []),
            "    /end CHARACTERISTIC",
        ]
    return lines


def _channels() -> list[str]:
    lines = _choices("words.state", STATES)
    for k in range(lib.ht_channel_count()):
        row = lib.ht_channel_describe(k)
        name, unit, about = (
            firmware.ffi.string(t).decode() for t in (row.name, row.unit, row.help)
        )
        method = "words.state" if name == "state" else "NO_COMPU_METHOD"
        least, most = (0, len(STATES) - 1) if name == "state" else (-ANY, ANY)
        lines += [
            f"    /begin MEASUREMENT {name} {quoted(about)}",
            f"      FLOAT32_IEEE {method} 0 0 {least!r} {most!r}",
            f"      ECU_ADDRESS {_address(lib.HT_NUMBER_XCP_CHANNELS_AT, k)}",
            *([f"      PHYS_UNIT {quoted(unit)}"] if unit else []),
            "    /end MEASUREMENT",
        ]
    return lines


def _groups() -> list[str]:
    """The parameters by the titles of their groups."""
    lines = []
    for k, (title, names) in enumerate(firmware.grouped(firmware.parameters()).items()):
        lines += [
            f"    /begin GROUP group{k} {quoted(title)}",
            "      ROOT",
            "      /begin REF_CHARACTERISTIC",
            *(f"        {parameter_name(name)}" for name in names),
            "      /end REF_CHARACTERISTIC",
            "    /end GROUP",
        ]
    return lines


def _protocol(port: int, baud: int) -> list[str]:
    lists = lib.HT_NUMBER_XCP_LISTS
    times = " ".join([str(ANSWER_MS)] + ["2000"] * 6)
    return [
        "    /begin IF_DATA XCP",
        "      /begin PROTOCOL_LAYER",
        f"        0x0100 {times} {lib.HT_NUMBER_XCP_CTO} {lib.HT_NUMBER_XCP_DTO}",
        "        BYTE_ORDER_MSB_LAST ADDRESS_GRANULARITY_BYTE",
        *(f"        OPTIONAL_CMD {quoted(name)}" for name in OPTIONAL),
        "      /end PROTOCOL_LAYER",
        "      /begin DAQ",
        "        DYNAMIC 0 2 0 OPTIMISATION_TYPE_DEFAULT ADDRESS_EXTENSION_FREE",
        "        IDENTIFICATION_FIELD_TYPE_ABSOLUTE GRANULARITY_ODT_ENTRY_SIZE_DAQ_DWORD",
        f"        {lib.HT_NUMBER_XCP_VALUE} OVERLOAD_INDICATION_EVENT PRESCALER_SUPPORTED",
        "        /begin TIMESTAMP_SUPPORTED",
        "          1 SIZE_DWORD UNIT_1US TIMESTAMP_FIXED",
        "        /end TIMESTAMP_SUPPORTED",
        f'        /begin EVENT "fast interrupt" "fast" 0 DAQ {lists} 0 0 0 /end EVENT',
        f'        /begin EVENT "slow interrupt" "slow" 1 DAQ {lists} 0 0 0 /end EVENT',
        "      /end DAQ",
        "      /begin PAG 1 /end PAG",
        f'      /begin XCP_ON_TCP_IP 0x0100 {port} ADDRESS "127.0.0.1" /end XCP_ON_TCP_IP',
        f'      /begin XCP_ON_UDP_IP 0x0100 {port} ADDRESS "127.0.0.1" /end XCP_ON_UDP_IP',
        f"      /begin XCP_ON_SxI 0x0100 {baud}",
        "        /begin ASYNCH_FULL_DUPLEX_MODE",
        "          PARITY_NONE ONE_STOP_BIT",
        "        /end ASYNCH_FULL_DUPLEX_MODE",
        "        HEADER_LEN_CTR_WORD CHECKSUM_WORD",
        "      /end XCP_ON_SxI",
        "    /end IF_DATA",
    ]


def _memory() -> list[str]:
    begin = _address(lib.HT_NUMBER_XCP_PARAMETERS_AT, 0)
    size = lib.HT_NUMBER_XCP_VALUE * lib.ht_param_count()
    return [
        '    /begin MOD_PAR ""',
        '      /begin MEMORY_SEGMENT parameters "in force, or kept"',
        f"        DATA RAM INTERN {begin} {size} -1 -1 -1 -1 -1",
        "        /begin IF_DATA XCP",
        "          /begin SEGMENT 0 2 0 0 0",
        "            /begin PAGE 0 ECU_ACCESS_DONT_CARE XCP_READ_ACCESS_DONT_CARE",
        "              XCP_WRITE_ACCESS_DONT_CARE /end PAGE",
        "            /begin PAGE 1 ECU_ACCESS_NOT_ALLOWED XCP_READ_ACCESS_DONT_CARE",
        "              XCP_WRITE_ACCESS_NOT_ALLOWED /end PAGE",
        "          /end SEGMENT",
        "        /end IF_DATA",
        "      /end MEMORY_SEGMENT",
        "    /end MOD_PAR",
    ]


def text(port: int, baud: int = BAUD) -> str:
    """The file's text. port: of a virtual board's XCP, TCP and UDP; baud: of a serial port."""
    lines = [
        "ASAP2_VERSION 1 71",
        "/begin PROJECT hexatorque_project " + quoted("six-phase drive"),
        f"  /begin HEADER {quoted('')} VERSION {quoted(__version__)} /end HEADER",
        "  /begin MODULE hexatorque " + quoted("parameters and channels by virtual addresses"),
        "    /begin A2ML" + A2ML + "    /end A2ML",
        '    /begin MOD_COMMON ""',
        "      BYTE_ORDER MSB_LAST",
        "      ALIGNMENT_FLOAT32_IEEE 4",
        "    /end MOD_COMMON",
        *_memory(),
        *_protocol(port, baud),
        "    /begin RECORD_LAYOUT value",
        "      FNC_VALUES 1 FLOAT32_IEEE ROW_DIR DIRECT",
        "    /end RECORD_LAYOUT",
        *_parameters(),
        *_channels(),
        *_groups(),
        "  /end MODULE",
        "/end PROJECT",
    ]
    return "\n".join(lines) + "\n"
