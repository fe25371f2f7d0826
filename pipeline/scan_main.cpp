// pipeline/scan_main.cpp: the program lamina-scan, a filter that lamina runs: a request as JSON on standard input; on
// standard output the result as one line of JSON, followed by a PNG picture, if requested. Errors are one line there.
#include <cstdio>
#include <iostream>
#include <string>

#include "pipeline/calibrate/scan_answer.h"
#include "stages/data/shortage.h"
#include "stages/formats/chart/chart.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/json_text.h"

namespace lamina::pipeline {
namespace {

Error at_photo(const std::string& path, const Error& error) { return {error.fault, path + ": " + error.message}; }

Result<std::string> answer(const Json& json, const cv::Mat& picture) {
  std::string text = json_line(json);
  if (picture.empty()) return text;
  const auto png = calibration::png_of(picture);
  return png ? Result<std::string>(text + *png) : png.error();
}

/// {"photo": path, "chart": ..., "picture": whether}
Result<std::string> read_chart_of(const Json& request) {
  constexpr int kMin = 200;
  const auto path = request.at("photo").get<std::string>();
  const auto chart = read_chart(json_text(request.at("chart")), "the chart");
  if (!chart) return chart.error();
  const auto photo = calibration::read_photo(path, kMin);
  if (!photo) return photo.error();
  const auto reading = calibration::read_chart_photo(*photo, *chart);
  if (!reading) return at_photo(path, reading.error());
  return answer(reading_json(*reading), request.contains("picture") && request.at("picture").get<bool>()
                                            ? calibration::picture_of(*photo, *chart, *reading)
                                            : cv::Mat());
}

/// {"photo": path, "photo_um", "scan_along_x", "pixel_nm": [x, y], "columns", "row_offset", "change"}
Result<std::string> compare_with(const Json& request) {
  constexpr int kMin = 50;
  const auto path = request.at("photo").get<std::string>();
  Runs image;
  image.columns = request.at("columns").get<std::uint32_t>();
  for (const Json& value : request.at("row_offset")) image.row_offset.push_back(value.get<std::uint32_t>());
  for (const Json& value : request.at("change")) image.change.push_back(value.get<std::uint32_t>());
  bool good = !image.row_offset.empty() && image.row_offset[0] == 0 && image.row_offset.back() == image.change.size();
  for (std::size_t r = 1; good && r < image.row_offset.size(); ++r) good = image.row_offset[r - 1] <= image.row_offset[r];
  for (std::size_t i = 0; good && i < image.change.size(); ++i) good = image.change[i] <= image.columns;
  const calibration::ExpectedLayer layer{image.view(), request.at("pixel_nm").at(0).get<double>(),
                                         request.at("pixel_nm").at(1).get<double>(), request.at("scan_along_x").get<bool>(),
                                         request.at("photo_um").get<double>()};
  good = good && layer.pixel_x_nm >= 1 && layer.pixel_y_nm >= 1 && layer.photo_um >= 1;
  if (!good) return Error{Fault::kUsage, "the request contains no image"};
  const auto photo = calibration::read_photo(path, kMin);
  if (!photo) return photo.error();
  const auto comparison = calibration::compare_layer(*photo, layer);
  if (!comparison) return at_photo(path, comparison.error());
  return json_line(comparison_json(*comparison));
}

Result<std::string> run(const std::string& what) {
  if (what != "chart" && what != "compare")
    return Error{Fault::kUsage, "lamina-scan is run by lamina calibrate and lamina compare"};
  const auto text = read_file("-", {.fault = Fault::kUsage, .max_bytes = 1u << 30, .streams = true});
  if (!text) return text.error();
  if (!json_nests_within(*text)) return Error{Fault::kUsage, "the request nests too deep"};
  return what == "chart" ? read_chart_of(parse_json(*text)) : compare_with(parse_json(*text));
}

int end(const Result<std::string>& result) {
  const std::string& text = result ? *result : result.error().message;
  const bool whole = std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  return !result ? static_cast<int>(result.error().fault) : whole ? 0 : static_cast<int>(Fault::kOutput);
}

}  // namespace
}  // namespace lamina::pipeline

int main(int count, char** words) {
  using namespace lamina;
  try {
    return pipeline::end(pipeline::run(count == 2 ? words[1] : ""));
  } catch (const std::exception& error) {
    return pipeline::end(is_shortage(error) ? shortage(error)
                                            : Error{Fault::kInternal, std::string("internal error: ") + error.what()});
  }
}
