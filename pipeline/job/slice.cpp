// Section [slice].
#include <vector>

#include "pipeline/job/keys.h"
#include "stages/formats/slice_format.h"

namespace lamina::pipeline {
namespace {

std::vector<std::string_view> slice_format_words() {
  std::vector<std::string_view> words;
  for (const write::SliceFormat& format : write::slice_formats()) words.push_back(format.id);
  return words;
}

std::string check_slice_format(std::string_view text) {
  return write::find_slice_format(text) != nullptr ? "" : not_one_of(text, slice_format_words());
}

constexpr unsigned kContour = decides::contours | decides::moves;

const JobKey kSliceKeys[] = {
    text<check_slice_format, &Job::slice, &SliceRequest::format>(
        {"slice", "format", "--format", "FORMAT", "svg, svg-polygon, cli, cli-binary, cli-16, 3mf, or null to write none",
         decides::contours})
        .with_words(slice_format_words),
    field<&Job::slice, &SliceRequest::file_a_layer>({"slice", "file_a_layer", "--file-a-layer", "",
                                                     "one file for each layer, layers/000000.svg and up", decides::contours,
                                                     "true"}),
    field<&Job::slice, &SliceRequest::empty_first_layer>(
        {"slice", "empty_first_layer", "--empty-first-layer", "",
         "CLI: begin with an empty layer at the bottom, from which readers infer the thickness", decides::contours, "true"}),
    field<&Job::slice, &SliceRequest::tolerance_um>(
        {"slice", "tolerance_um", "--tolerance", "UM", "points are left out if the contour moves by no more, in micrometres",
         kContour},
        {0, 1e6, " um"}),
    field<&Job::slice, &SliceRequest::bridge_mm>(
        {"slice", "bridge_mm", "--bridge", "MM", "longest gap of an open mesh (--no-repair) that is closed, in mm", kContour},
        {0, 1000, " mm"}),
    field<&Job::slice, &SliceRequest::offset_mm>(
        {"slice", "offset_mm", "--offset", "MM", "contours are moved outwards by this, inwards if negative", kContour},
        {-1000, 1000, " mm"}),
};

}  // namespace

std::span<const JobKey> slice_keys() { return kSliceKeys; }

}  // namespace lamina::pipeline
