#include "stages/formats/chart/chart.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/support/text/json_text.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina {
namespace {

constexpr const char* kKind = "lamina chart 1";
constexpr std::uint32_t kMaxSide = 1u << 20;
constexpr double kMaxLengthMm = 1000, kMaxImageMm = 10'000;

Json box_json(const ChartBox& box) { return Json::array({box.left, box.top, box.right, box.bottom}); }

ChartBox box_of(const Json& json, const Chart& chart) {
  ChartBox box{json.at(0).get<std::uint32_t>(), json.at(1).get<std::uint32_t>(), json.at(2).get<std::uint32_t>(),
               json.at(3).get<std::uint32_t>()};
  if (box.left >= box.right || box.top >= box.bottom || box.right > chart.columns || box.bottom > chart.rows)
    throw std::out_of_range("a box lies outside of the image");
  return box;
}

ChartVernier vernier_of(const Json& json, const Chart& chart) {
  ChartVernier vernier{json.at(0).get<std::uint32_t>(), {}, {}};
  for (const Json& tick : json.at(1)) vernier.before.push_back(box_of(tick, chart));
  for (const Json& tick : json.at(2)) vernier.after.push_back(box_of(tick, chart));
  if (vernier.swath == 0 || vernier.swath >= chart.swaths || vernier.before.size() != vernier.after.size() ||
      vernier.before.empty())
    throw std::out_of_range("a vernier is of no joint");
  return vernier;
}

Chart chart_of(const Json& json) {
  if (json.at("kind") != kKind) throw std::out_of_range("it is of another kind");
  Chart chart;
  chart.machine = json.at("machine").get<std::string>();
  chart.columns = json.at("columns").get<std::uint32_t>();
  chart.rows = json.at("rows").get<std::uint32_t>();
  if (chart.columns > kMaxSide || chart.rows > kMaxSide) throw std::out_of_range("its image is too large");
  chart.pixel_x_nm = json.at("pixel_nm").at(0).get<double>();
  chart.pixel_y_nm = json.at("pixel_nm").at(1).get<double>();
  if (!(chart.pixel_x_nm >= 1000 && chart.pixel_x_nm <= kMaxLengthMm * 1e6) ||
      !(chart.pixel_y_nm >= 1000 && chart.pixel_y_nm <= kMaxLengthMm * 1e6))
    throw std::out_of_range("its pixels have no size");
  if (chart.columns * chart.pixel_x_nm > kMaxImageMm * 1e6 || chart.rows * chart.pixel_y_nm > kMaxImageMm * 1e6)
    throw std::out_of_range("its image is too large");
  chart.scan_along_x = json.at("scan") == "x";
  chart.along_sign = json.at("along_sign").get<int>() < 0 ? -1 : 1;
  chart.across_sign = json.at("across_sign").get<int>() < 0 ? -1 : 1;
  chart.nozzles = json.at("nozzles").get<std::uint32_t>();
  chart.nozzle_rows = json.at("nozzle_rows").get<std::uint32_t>();
  chart.swaths = json.at("swaths").get<std::uint32_t>();
  if (chart.nozzles == 0 || chart.nozzles > 65'535 || chart.nozzle_rows == 0 || chart.nozzle_rows > chart.nozzles ||
      chart.swaths == 0 || chart.swaths > 1000)
    throw std::out_of_range("it has no nozzles, or too many");
  chart.between_mm = json.at("between_mm").get<double>();
  chart.gap_mm = json.at("gap_mm").get<double>();
  chart.mark_mm = json.at("mark_mm").get<double>();
  for (const double mm : {chart.between_mm, chart.gap_mm, chart.mark_mm}) {
    if (!(mm > 0 && mm <= kMaxLengthMm)) throw std::out_of_range("its lengths are not positive, or too large");
  }
  if (json.contains("layer_mm")) json.at("layer_mm").get_to(chart.layer_mm);
  if (!(chart.layer_mm >= 0 && chart.layer_mm <= kMaxLengthMm)) throw std::out_of_range("its layer has no thickness");
  for (const Json& mark : json.at("marks")) chart.marks.push_back(box_of(mark, chart));
  if (chart.marks.size() != 4) throw std::out_of_range("it has not four marks");
  for (const Json& dash : json.at("dashes")) {
    const ChartDash one{dash.at(0).get<std::uint32_t>(), dash.at(1).get<std::uint32_t>(), dash.at(2).get<std::uint32_t>(),
                        box_of(dash.at(3), chart)};
    if (one.swath >= chart.swaths || one.nozzle >= chart.nozzles) throw std::out_of_range("a dash is of no nozzle");
    chart.dashes.push_back(one);
  }
  for (const Json& bar : json.at("bars")) chart.bars.push_back({bar.at(0).get<bool>(), box_of(bar.at(1), chart)});
  for (const Json& wedge : json.at("wedges")) {
    const ChartWedge one{wedge.at(0).get<double>(), box_of(wedge.at(1), chart)};
    if (!(one.percent > 0 && one.percent <= 100)) throw std::out_of_range("a wedge has no share of pixels");
    chart.wedges.push_back(one);
  }
  for (const Json& joint : json.at("stitches")) chart.stitches.push_back(box_of(joint, chart));
  if (chart.stitches.size() >= std::max(chart.swaths, 1u)) throw std::out_of_range("it has more joints than swaths");
  if (!json.contains("verniers")) return chart;
  for (const Json& one : json.at("verniers")) chart.verniers.push_back(vernier_of(one, chart));
  return chart;
}

}  // namespace

std::string chart_text(const Chart& chart) {
  Json json = {{"kind", kKind},
               {"machine", chart.machine},
               {"columns", chart.columns},
               {"rows", chart.rows},
               {"pixel_nm", {chart.pixel_x_nm, chart.pixel_y_nm}},
               {"scan", chart.scan_along_x ? "x" : "y"},
               {"along_sign", chart.along_sign},
               {"across_sign", chart.across_sign},
               {"nozzles", chart.nozzles},
               {"nozzle_rows", chart.nozzle_rows},
               {"swaths", chart.swaths},
               {"between_mm", chart.between_mm},
               {"gap_mm", chart.gap_mm},
               {"mark_mm", chart.mark_mm},
               {"layer_mm", chart.layer_mm}};
  for (const char* list : {"marks", "dashes", "bars", "wedges", "stitches", "verniers"}) json[list] = Json::array();
  for (const ChartBox& box : chart.marks) json["marks"].push_back(box_json(box));
  for (const ChartDash& dash : chart.dashes)
    json["dashes"].push_back(Json::array({dash.swath, dash.nozzle, dash.repeat, box_json(dash.box)}));
  for (const ChartBar& bar : chart.bars) json["bars"].push_back(Json::array({bar.along, box_json(bar.box)}));
  for (const ChartWedge& wedge : chart.wedges) json["wedges"].push_back(Json::array({wedge.percent, box_json(wedge.box)}));
  for (const ChartBox& box : chart.stitches) json["stitches"].push_back(box_json(box));
  for (const ChartVernier& vernier : chart.verniers) {
    Json before = Json::array(), after = Json::array();
    for (const ChartBox& tick : vernier.before) before.push_back(box_json(tick));
    for (const ChartBox& tick : vernier.after) after.push_back(box_json(tick));
    json["verniers"].push_back(Json::array({vernier.swath, before, after}));
  }
  return json_line(json);
}

Result<Chart> read_chart(std::string_view text, const std::string& where) {
  const auto refused = [&](const std::string& why) {
    return Error{Fault::kInput, fmt::format("{}: is no chart of lamina calibrate: {}", one_line(where), one_line(why))};
  };
  if (!json_nests_within(text)) return refused("it nests too deep");
  try {
    return chart_of(parse_json(text));
  } catch (const std::exception& error) {
    return refused(error.what());
  }
}

}  // namespace lamina
