// Section [segment].
#include "pipeline/job/keys.h"
#include "stages/support/text/ranges.h"

namespace lamina::pipeline {
namespace {

using segment::CutRule;

constexpr Word<CutRule> kRules[] = {
    {"aligned", CutRule::kAligned}, {"fukuda", CutRule::kGrid}, {"thick-ends", CutRule::kThickEnds}};

// Wide limits for lengths and percentages: segment::check refuses invalid ones with a reason.
constexpr Limits kAny{-1e6, 1e6};

constexpr Key<SegmentSettings> kSegmentKeys[] = {
    field<&SegmentSettings::on>({"segment", "on", "", "", "lines are segmented"}),
    word<kRules, &SegmentSettings::rule>(
        {"segment", "rule", "--segment-rule", "RULE",
         "aligned: a grid fixed to the part, ends thick; fukuda: the grid as it falls; thick-ends: each line on its own"}),
    field<&SegmentSettings::thick_mm>({"segment", "thick_mm", "--thick", "MM", "length of a thick stretch"}, kAny),
    field<&SegmentSettings::thin_mm>({"segment", "thin_mm", "--thin", "MM", "length of a thin stretch"}, kAny),
    field<&SegmentSettings::least_end_mm>(
        {"segment", "least_end_mm", "", "MM", "thick ends are at least so long; half of thick_mm if absent"}, kAny),
    field<&SegmentSettings::continuous>(
        {"segment", "continuous_lines", "--continuous", "N", "continuous lines between two segmented ones"}, {1, 1000}),
    field<&SegmentSettings::first>({"segment", "first_line", "", "N", "number of a segmented line"}, {-1000, 1000}),
    field<&SegmentSettings::spacing_sc_mm>(
        {"segment", "spacing_sc_mm", "--spacing-sc", "MM",
         "from a segmented line to the continuous one beside it, centre to centre; from the widths if absent"},
        kAny),
    field<&SegmentSettings::spacing_cc_mm>(
        {"segment", "spacing_cc_mm", "--spacing-cc", "MM", "the same between continuous lines"}, kAny),
    field<&SegmentSettings::gap_mm>({"segment", "gap_mm", "--segment-gap", "MM",
                                     "wanted between thick beads and their neighbours, for spacings from the widths"},
                                    kAny),
    field<&SegmentSettings::thick_extrusion>({"segment", "thick_extrusion_percent", "--extrusion", "%",
                                              "extrusion of thick stretches, and of thin ones if theirs is absent"},
                                             kAny),
    field<&SegmentSettings::thin_extrusion>({"segment", "thin_extrusion_percent", "", "%", "extrusion of thin stretches"},
                                            kAny),
    field<&SegmentSettings::thick_speed>(
        {"segment", "thick_speed_percent", "--thick-speed", "%", "speed of thick stretches; by the extrusion if absent"}, kAny),
    field<&SegmentSettings::thin_speed>({"segment", "thin_speed_percent", "--thin-speed", "%", "speed of thin stretches"},
                                        kAny),
    field<&SegmentSettings::thin_speed_sweep>({"segment", "thin_speed_sweep", "", "%,%,...",
                                               "speeds of thin stretches, from one segmented line to the next: a test piece"},
                                              kAny),
    field<&SegmentSettings::thin_extrusion_sweep>(
        {"segment", "thin_extrusion_sweep", "", "%,%,...", "the same of their extrusion"}, kAny),
    field<&SegmentSettings::thick_width_mm>({"segment", "thick_width_mm", "--thick-width", "MM",
                                             "width that thick stretches will have; by the calibration if absent"},
                                            kAny),
    field<&SegmentSettings::thin_width_mm>({"segment", "thin_width_mm", "--thin-width", "MM", "the same of thin ones"}, kAny),
    field<&SegmentSettings::continuous_width_mm>({"segment", "continuous_width_mm", "", "MM", "the same of continuous lines"},
                                                 kAny),
    field<&SegmentSettings::one_direction>({"segment", "one_direction", "", "", "all segmented lines are laid the same way"}),
    field<&SegmentSettings::even_starts>(
        {"segment", "even_starts", "", "", "lines begin with the flow they keep, where the machine's material.lag_s is known"}),
    field<&SegmentSettings::shift_mm>({"segment", "shift_mm", "--pore-shift", "MM[,MM...]",
                                       "pores are moved along the lines by these, layer by layer in turn"},
                                      {-1000, 1000, " mm", false, 1}),
    field<&SegmentSettings::across>(
        {"segment", "across", "", "",
         "thin stretches have their middles on the segmented lines of the turned layer (thick_mm + thin_mm a multiple of their distance)"}),
};

std::string read_segment_ranges(const TomlValue& list, std::vector<Range<SegmentSettings>>& ranges, Place& at) {
  return read_ranges<SegmentSettings>(list, kSegmentKeys, ranges, at);
}
std::string segment_ranges_text(const std::vector<Range<SegmentSettings>>& ranges) {
  return ranges_text<SegmentSettings>(kSegmentKeys, ranges);
}

// Option --fill sets the filling with one word; files use fill.pattern and segment.on.
std::string read_filling(std::string_view word, Job& job) {
  if (word == "segmented") {
    job.segment.all.on = true;
    return {};
  }
  if (FillRule rule{}; read_fill_rule(word, rule).empty()) {
    return fmt::format("'{}' is a rule for shells that overlap; give --fill-rule {} (image.fill in a file)", word, word);
  }
  const std::string wrong = fill_settings_keys().front().read(word, job.fill.all);
  if (wrong.empty()) job.segment.all.on = false;  // a pattern instead of the segmented lines of a file
  return wrong.empty() ? wrong : wrong + "; or segmented";
}
std::vector<std::string_view> fillings() {
  auto words = fill_settings_keys().front().words();
  words.push_back("segmented");
  return words;
}
std::string write_no_filling(const Job&) { return {}; }

}  // namespace

std::span<const Key<SegmentSettings>> segment_settings_keys() { return kSegmentKeys; }

std::span<const JobKey> segment_keys() {
  static const std::vector<JobKey> keys = [] {
    std::vector<JobKey> all;
    for (const auto& key : kSegmentKeys)
      all.push_back(inside<&Job::segment, &SegmentRequest::all>(key, "segment", decides::moves));
    all.push_back(structure<read_segment_ranges, segment_ranges_text, &Job::segment, &SegmentRequest::ranges>(
        {"segment", "range", "", "[{...}]", "other keys between two heights: from_mm, to_mm and the keys that differ",
         decides::moves}));
    all.push_back(
        custom<Job, read_filling, write_no_filling>(
            {"segment", "fill", "--fill", "FILLING",
             "what is laid inside: segmented, or a pattern: none, raster, contour, contour+raster, honeycomb, quatrefoil"},
            Form::kString)
            .with_words(fillings));
    return all;
  }();
  return keys;
}

}  // namespace lamina::pipeline
