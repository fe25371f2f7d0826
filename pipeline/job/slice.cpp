#include "pipeline/job/keys.h"
#include "pipeline/text/key_text.h"

namespace lamina::pipeline {
namespace {

using Form = KeyForm;
using Text = std::string_view;

constexpr Word<int> kFormats[] = {{"svg", 0}, {"cli", 1}, {"cli-binary", 2}, {"3mf", 3}, {"null", 4}};

// None of them decides the bytes of images, and the manifests of contours list them on their own.
const JobKey kSliceKeys[] = {
    {"slice", "format", "--format", "FORMAT", "svg, cli, cli-binary, 3mf, or null to write none", false,
     [](Text t, Job& j) {
       int ignored = 0;
       auto wrong = read_word(kFormats, t, ignored);
       if (wrong.empty()) j.slice.format = t;
       return wrong;
     },
     [](const Job& j) { return j.slice.format; }, Form::kString},
    {"slice", "file_a_layer", "--file-a-layer", "", "one file for each layer, layers/000000.svg and up", false,
     [](Text t, Job& j) { return read_switch(t, j.slice.file_a_layer); },
     [](const Job& j) { return write_switch(j.slice.file_a_layer); }, Form::kBare, "true"},
    {"slice", "empty_first_layer", "--empty-first-layer", "",
     "CLI: begin with an empty layer at the bottom, from which readers infer the thickness", false,
     [](Text t, Job& j) { return read_switch(t, j.slice.empty_first_layer); },
     [](const Job& j) { return write_switch(j.slice.empty_first_layer); }, Form::kBare, "true"},
    {"slice", "tolerance_um", "--tolerance", "UM", "points are dropped if the contour moves by no more, in micrometres", false,
     [](Text t, Job& j) { return read_number(t, 0, 1e6, " um", j.slice.tolerance_um); },
     [](const Job& j) { return number_text(j.slice.tolerance_um); }, Form::kBare},
    {"slice", "bridge_mm", "--bridge", "MM", "longest gap of an open mesh (--no-repair) that is closed, in mm", false,
     [](Text t, Job& j) { return read_number(t, 0, 1000, " mm", j.slice.bridge_mm); },
     [](const Job& j) { return number_text(j.slice.bridge_mm); }, Form::kBare},
    {"slice", "offset_mm", "--offset", "MM", "contours are moved outwards by this, inwards if negative", false,
     [](Text t, Job& j) { return read_number(t, -1000, 1000, " mm", j.slice.offset_mm); },
     [](const Job& j) { return number_text(j.slice.offset_mm); }, Form::kBare},
};

}  // namespace

std::span<const JobKey> slice_keys() { return kSliceKeys; }

}  // namespace lamina::pipeline
