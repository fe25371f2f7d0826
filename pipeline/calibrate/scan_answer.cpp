// Part of lamina-scan, which links OpenCV.
#include "pipeline/calibrate/scan_answer.h"

#include <cmath>

namespace lamina::pipeline {

Json reading_json(const calibration::ChartReading& reading) {
  const auto rounded = [](double um) { return std::round(100 * um) / 100; };
  const auto offsets = [&](const std::vector<std::optional<calibration::Offset>>& list) {
    Json json = Json::array();
    for (const auto& one : list) {
      Json& entry = json.emplace_back();
      if (!one) continue;
      const auto add = [&](const char* name, const char* error, const char* within, const calibration::Measure& measure) {
        entry[name] = measure.known() ? Json(rounded(measure.um)) : Json();
        entry[error] = rounded(measure.error_um);
        entry[within] = rounded(measure.within_um);
      };
      add("along_um", "along_error_um", "along_within_um", one->along);
      add("across_um", "across_error_um", "across_within_um", one->across);
    }
    return json;
  };
  const calibration::HeadReading& head = reading.head;
  Json json = {{"pixels_per_mm", reading.pixels_a_mm},
               {"scatter_um", reading.scatter_um},
               {"blocked", head.blocked},
               {"weak", head.weak},
               {"unreadable", head.unreadable},
               {"swaths", offsets(head.swath)},
               {"nozzles", offsets(head.nozzle)}};
  // Where no bar across the scan is whole, what is known is the gain along it.
  const calibration::InkReading& inks = reading.inks;
  if (inks.bars_along > 0)
    json["dot_gain_um"] = {{"along", inks.gain_along_um},
                           {"across", inks.bars_across > 0 ? inks.gain_across_um : inks.gain_along_um}};
  json["stitches"] = Json::array();
  for (const calibration::JointReading& joint : reading.stitches) {
    json["stitches"].push_back({{"swath", joint.swath},
                                {"along_um", joint.along_um ? Json(rounded(*joint.along_um)) : Json()},
                                {"across_um", joint.across_um ? Json(rounded(*joint.across_um)) : Json()},
                                {"agrees", joint.agrees}});
  }
  json["wedges"] = Json::array();
  for (const auto& [percent, detected] : inks.wedges)
    json["wedges"].push_back({{"pixels_percent", percent}, {"detected_percent", detected}});
  return json;
}

Json comparison_json(const calibration::Comparison& comparison) {
  Json json = {{"likeness", comparison.position.likeness},
               {"rotation_deg", comparison.position.rotation_deg},
               {"also_deg", comparison.position.also_deg},
               {"missing", Json::array()},
               {"bodies", Json::array()},
               {"extra", Json::array()}};
  for (const calibration::MissingBand& band : comparison.bands)
    json["missing"].push_back({{"from_mm", band.from_mm}, {"to_mm", band.to_mm}, {"missing_mm", band.missing_mm}});
  for (const calibration::BodyReading& body : comparison.bodies)
    json["bodies"].push_back(
        {{"x_mm", body.x_mm}, {"y_mm", body.y_mm}, {"expected_mm2", body.expected_mm2}, {"detected_mm2", body.detected_mm2}});
  for (const calibration::ExtraInk& ink : comparison.extra)
    json["extra"].push_back({{"x_mm", ink.x_mm}, {"y_mm", ink.y_mm}, {"mm2", ink.mm2}});
  return json;
}

}  // namespace lamina::pipeline
