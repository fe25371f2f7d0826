// stages/formats/gcode/host_tags.h: commands for displays and hosts: progress, layers, and objects that can be left out of a
// running print.
//
//     M73 P12 R34                                       percent over, minutes left: Marlin, RepRapFirmware, Klipper's
//     display_status SET_PRINT_STATS_INFO TOTAL_LAYER=9                Klipper (docs/G-Codes.md, print_stats) M486 T2; M486 S0;
//     M486 S-1                        objects: how many, begins, ends (marlinfw.org and docs.duet3d.com, M486)
//     EXCLUDE_OBJECT_DEFINE NAME=a CENTER=1,2 POLYGON=[[0,0],...]; EXCLUDE_OBJECT_START NAME=a; EXCLUDE_OBJECT_END NAME=a
//                                                       Klipper (docs/Exclude_Object.md)
//
// Names are written for RepRapFirmware and Klipper: Marlin would read the letters of M486 A"..." as parameters.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/extruder.h"
#include "stages/formats/extrusion_format.h"

namespace lamina::formats::gcode {

/// In the head, for machines with tags of objects.
void append_objects(const Extruder& machine, std::span<const ExtrusionObject> objects, Buffer<char>& out);
/// The start or the end of an object in a layer.
void append_object_tag(const Extruder& machine, std::span<const ExtrusionObject> objects, std::uint32_t object, bool begins,
                       Buffer<char>& out);
/// At the start of a layer.
void append_progress(const Extruder& machine, const LayerSurroundings::Progress& progress, Buffer<char>& out);

}  // namespace lamina::formats::gcode
