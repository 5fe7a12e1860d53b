# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Definitions in IDL are those in ros2msg text."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
from lab_bags import Lab, short_recording, write_schemas

from push_predictor.recordings.bag.message_types import Field, msg_of_idl, parse_definitions
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.topics import Topics

RULE = "=" * 80
TIP = f"""{RULE}
IDL: lab_msgs/msg/Tip
// generated from rosidl_adapter/resource/msg.idl.em
#include "std_msgs/msg/Header.idl"
#include "lab_msgs/msg/Odom.idl"

module lab_msgs {{
  module msg {{
    typedef double double__16[16];
    module Tip_Constants {{
      const int8 K = 3;
    }};
    @verbatim (language="comment", text=
      "The tip; a \\"struct Tip {{ double x; }}\\" in a comment (of the author)." "\\n" "more")
    struct Tip {{
      /* first */
      sequence<string> notes;
      @default (value=1)
      @unit (value="m/s")
      int8 state;
      lab_msgs::msg::Odom odom;  // nested
      double__16 matrix;
      float volts[2];
      unsigned long  long count;
      sequence<octet, 3> raw;
      string<7> name;
      boolean on;
    }};
  }};
}};
{RULE}
IDL: lab_msgs/msg/Odom
module lab_msgs {{ module msg {{
  struct Odom {{ std_msgs::msg::Header header; geometry_msgs::msg::PoseStamped pose; }};
}}; }};
"""
SAME = {
    "lab_msgs/msg/Tip": "string[] notes\nint8 state\nOdom odom\nfloat64[16] matrix\nfloat32[2] volts\nuint64 count\n"
    "byte[] raw\nstring name\nbool on\n",
    "lab_msgs/msg/Odom": "std_msgs/Header header\ngeometry_msgs/PoseStamped pose\n",
}


def test_the_fields_of_idl_are_those_of_the_message_file() -> None:
    found = parse_definitions("lab_msgs/msg/Tip", msg_of_idl(TIP))
    wanted = parse_definitions("lab_msgs/msg/Tip", SAME["lab_msgs/msg/Tip"])
    assert found["lab_msgs/Tip"] == wanted["lab_msgs/Tip"]
    assert found["lab_msgs/Odom"] == (
        Field("std_msgs/Header", "header"),
        Field("geometry_msgs/PoseStamped", "pose"),
    )


@pytest.mark.parametrize(
    "text", ["", "double x", f"{RULE}\nIDL: a/msg/B\nmodule a {{", f"{RULE}\nIDL: a/msg/B\n}};;{{"]
)
def test_text_that_is_none_has_no_field(text: str) -> None:
    assert not any(parse_definitions("a/msg/B", msg_of_idl(text)).values())


def test_a_laboratorys_own_type_in_idl_is_read(tmp_path: Path) -> None:
    lab, whole = Lab(SAME), short_recording(1.0)
    lab.pose("/slider/pose", "geometry_msgs/msg/PoseStamped", whole.slider, "pose")
    extra = {"volts": np.array([1.5, 2.5], np.float32), "notes": ["a", "longer"]}
    lab.pose("/tip", "lab_msgs/msg/Tip", whole.pusher, "odom.pose.pose", "odom.pose.header", **extra)
    path = write_schemas(lab, tmp_path / "a.mcap", {"/tip": ("ros2idl", TIP)})
    found = read_recording(path, topics=Topics(pusher="/tip.odom.pose.pose", covariates=("/tip.volts[1]",)))
    assert found.pusher.x.tolist() == whole.pusher.x.tolist()
    assert set(found.scalars["/tip.volts[1]"].value.tolist()) == {2.5}
