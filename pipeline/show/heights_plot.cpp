#include "pipeline/show/heights_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/plan/heights.h"
#include "stages/write/file.h"

namespace lamina::pipeline {
namespace {

constexpr int kWidth = 1200, kHeight = 900, kTop = 96, kBottom = 70, kLeft = 80, kGap = 90, kRight = 150;
constexpr int kPlotHeight = kHeight - kTop - kBottom;
constexpr const char* kInk = "333333";
constexpr const char* kPale = "dddddd";

const char* colour_of(LayerReason reason) {
  switch (reason) {
    case LayerReason::kSlope:
    case LayerReason::kCusp: return "d9822b";
    case LayerReason::kPeak:
    case LayerReason::kFlat: return "3f8f5f";
    default: return "4a78b5";
  }
}

// From where to where the parts reach in x, for each of `rows` rows from the bed up; first > second where there is none.
std::vector<std::pair<double, double>> outline(const Scene& scene, double top_nm, int rows) {
  std::vector<std::pair<double, double>> reach(static_cast<std::size_t>(rows), {1e300, -1e300});
  const double row_nm = top_nm / rows;
  const auto edge = [&](const Point3& a, const Point3& b, const Point3& offset) {
    double za = static_cast<double>(a.z) + offset.z, zb = static_cast<double>(b.z) + offset.z;
    double xa = static_cast<double>(a.x) + offset.x, xb = static_cast<double>(b.x) + offset.x;
    if (za > zb) {
      std::swap(za, zb);
      std::swap(xa, xb);
    }
    const int first = std::clamp(static_cast<int>(za / row_nm), 0, rows - 1);
    const int last = std::clamp(static_cast<int>(zb / row_nm), 0, rows - 1);
    for (int row = first; row <= last; ++row) {
      // Both ends of what the edge has within the row.
      for (const double z : {std::max(za, row * row_nm), std::min(zb, (row + 1) * row_nm)}) {
        const double x = zb > za ? xa + (xb - xa) * std::clamp((z - za) / (zb - za), 0.0, 1.0) : xa;
        auto& [low, high] = reach[static_cast<std::size_t>(row)];
        low = std::min({low, x, zb > za ? x : xb});
        high = std::max({high, x, zb > za ? x : xb});
      }
    }
  };
  for (const Instance& instance : scene.instances) {
    for (const Triangle& t : scene.meshes[instance.mesh].triangles) {
      edge(t.a, t.b, instance.offset);
      edge(t.b, t.c, instance.offset);
      edge(t.c, t.a, instance.offset);
    }
  }
  return reach;
}

// 1, 2 or 5 times a power of ten, so that about `count` steps cover `span`.
double tick_step(double span, int count) {
  const double raw = span / count, power = std::pow(10, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= raw) return factor * power;
  }
  return 10 * power;
}

std::string escaped(const std::string& line) {
  std::string text;
  for (const char c : line) {
    if (c == '<')
      text += "&lt;";
    else if (c == '>')
      text += "&gt;";
    else if (c == '&')
      text += "&amp;";
    else
      text += c;
  }
  return text;
}

}  // namespace

Drawing draw_study(const Scene& scene, const HeightsStudy& study) {
  Drawing drawing;
  drawing.width = kWidth;
  drawing.height = kHeight;
  const std::vector<std::int64_t>& boundaries = study.boundaries;
  const std::size_t layers = boundaries.size() - 1;
  const double top_nm = static_cast<double>(std::max(boundaries.back(), scene.height));
  const auto y_of = [&](double nm) { return kTop + kPlotHeight * (1 - nm / top_nm); };

  Box around;
  for (const PartSummary& part : scene.parts) around.add(part.bounds);
  for (const Instance& instance : scene.instances) {
    const Box& box = scene.meshes[instance.mesh].bounds;
    around.add(Point3{box.lo.x + instance.offset.x, box.lo.y + instance.offset.y, box.lo.z + instance.offset.z});
    around.add(Point3{box.hi.x + instance.offset.x, box.hi.y + instance.offset.y, box.hi.z + instance.offset.z});
  }
  // The outline keeps its proportions unless it is too wide for its half.
  const double half = (kWidth - kLeft - kGap - kRight) / 2.0;
  const double x_scale = std::min(kPlotHeight / top_nm, half / static_cast<double>(std::max<std::int64_t>(around.width(), 1)));
  const double middle = kLeft + half / 2;
  const double x_middle = 0.5 * (static_cast<double>(around.lo.x) + around.hi.x);
  const auto reach = outline(scene, top_nm, kPlotHeight);
  for (int row = 0; row < kPlotHeight; ++row) {
    const auto [low, high] = reach[static_cast<std::size_t>(row)];
    if (low > high) continue;
    drawing.boxes.push_back({middle + (low - x_middle) * x_scale, static_cast<double>(kTop + kPlotHeight - 1 - row),
                             std::max(1.0, (high - low) * x_scale), 1, "b9c3cf"});
  }

  const double plot_left = kLeft + half + kGap;
  std::int64_t thickest = 0;
  for (std::size_t i = 0; i < layers; ++i) thickest = std::max(thickest, boundaries[i + 1] - boundaries[i]);
  const double t_scale = half / (static_cast<double>(thickest) * 1.05);
  const double t_step = tick_step(mm(thickest), 6), z_step = tick_step(top_nm * 1e-6, 12);
  for (double t = 0; t * 1e6 * t_scale <= half; t += t_step) {
    drawing.boxes.push_back({plot_left + t * 1e6 * t_scale, kTop, 1, kPlotHeight, kPale});
    drawing.texts.push_back({plot_left + t * 1e6 * t_scale, kTop + kPlotHeight + 20.0, 14, Drawing::Anchor::kMiddle, kInk,
                             fmt::format("{:.4g}", t)});
  }
  for (double z = 0; z * 1e6 <= top_nm; z += z_step) {
    drawing.boxes.push_back({kLeft - 6.0, y_of(z * 1e6), 6, 1, kInk});
    drawing.texts.push_back({kLeft - 10.0, y_of(z * 1e6) + 5, 14, Drawing::Anchor::kEnd, kInk, fmt::format("{:.4g}", z)});
  }
  // Equal neighbours are one box.
  for (std::size_t first = 0, last = 0; first < layers; first = last) {
    const std::int64_t thickness = boundaries[first + 1] - boundaries[first];
    const auto reason = [&](std::size_t i) { return study.reasons.empty() ? LayerReason::kUniform : study.reasons[i]; };
    while (last < layers && boundaries[last + 1] - boundaries[last] == thickness && reason(last) == reason(first)) ++last;
    const double top = y_of(static_cast<double>(boundaries[last])), bottom = y_of(static_cast<double>(boundaries[first]));
    drawing.boxes.push_back({plot_left, top, static_cast<double>(thickness) * t_scale, bottom - top, colour_of(reason(first))});
  }
  double last_label = 1e9;
  for (const heights::FlatHit& hit : study.evaluation.flats) {
    const bool missed = hit.miss > study.options.surface.flat_tolerance;
    const char* colour = missed ? "c62f2f" : "1d5c36";
    const double y = y_of(static_cast<double>(hit.flat.height));
    drawing.boxes.push_back({static_cast<double>(kLeft), y, kWidth - kRight - static_cast<double>(kLeft), 1, colour});
    if (last_label - y < 15) continue;
    last_label = y;
    drawing.texts.push_back({kWidth - kRight + 6.0, y + 5, 13, Drawing::Anchor::kStart, colour,
                             missed ? fmt::format("{:.3f}: off {:.3f}", mm(hit.flat.height), mm(hit.miss))
                                    : fmt::format("{:.3f}", mm(hit.flat.height))});
  }

  std::string title = std::filesystem::path(scene.parts.front().path).filename().string();
  if (scene.parts.size() > 1) title += fmt::format(" and {} more", scene.parts.size() - 1);
  const heights::Evaluation& e = study.evaluation;
  drawing.texts.push_back(
      {kLeft, 34, 20, Drawing::Anchor::kStart, kInk, fmt::format("{}: {} layers, {}", title, layers, study.name)});
  drawing.texts.push_back(
      {kLeft, 60, 15, Drawing::Anchor::kStart, kInk,
       fmt::format("step up to {:.4f} mm, {:.4f} mm on average; {} of {} flats hit; top {:+.4f} mm", mm(e.largest_cusp),
                   e.mean_cusp * 1e-6, e.flats.size() - e.flats_missed, e.flats.size(), mm(e.top_miss))});
  double legend = plot_left;
  for (const auto& [reason, name] :
       {std::pair{LayerReason::kUniform, "thickest"}, {LayerReason::kCusp, "slope"}, {LayerReason::kFlat, "to meet a flat"}}) {
    drawing.boxes.push_back({legend, kTop - 20.0, 12, 12, colour_of(reason)});
    drawing.texts.push_back({legend + 17, kTop - 9.0, 14, Drawing::Anchor::kStart, kInk, name});
    legend += 40 + 8.0 * static_cast<double>(std::string_view(name).size());
  }
  drawing.texts.push_back(
      {plot_left + half / 2, kHeight - 18.0, 15, Drawing::Anchor::kMiddle, kInk, "thickness of the layer, mm"});
  drawing.texts.push_back({middle, kHeight - 18.0, 15, Drawing::Anchor::kMiddle, kInk, "outline from the front; height, mm"});
  return drawing;
}

std::string svg_text(const Drawing& drawing) {
  std::string text = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"DejaVu Sans, sans-serif\">\n<!-- drawn by lamina -->\n<rect width=\"{0}\" height=\"{1}\" fill=\"#ffffff\"/>\n",
      drawing.width, drawing.height);
  for (const Drawing::Box& box : drawing.boxes) {
    text += fmt::format("<rect x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" fill=\"#{}\"/>\n", box.left,
                        box.top, box.width, box.height, box.colour);
  }
  for (const Drawing::Text& line : drawing.texts) {
    const char* anchor = line.anchor == Drawing::Anchor::kStart ? "start"
                         : line.anchor == Drawing::Anchor::kEnd ? "end"
                                                                : "middle";
    text += fmt::format("<text x=\"{:.2f}\" y=\"{:.2f}\" font-size=\"{}\" text-anchor=\"{}\" fill=\"#{}\">{}</text>\n", line.x,
                        line.baseline, line.size, anchor, line.colour, escaped(line.line));
  }
  return text + "</svg>\n";
}

std::string drawing_text(const Drawing& drawing) {
  std::string text = fmt::format("drawing {} {}\n", drawing.width, drawing.height);
  for (const Drawing::Box& box : drawing.boxes) {
    // Edges are rounded, not sizes, so that neighbours touch.
    const long left = std::lround(box.left), top = std::lround(box.top);
    text += fmt::format("box {} {} {} {} {}\n", left, top, std::max(1l, std::lround(box.left + box.width) - left),
                        std::max(1l, std::lround(box.top + box.height) - top), box.colour);
  }
  for (const Drawing::Text& line : drawing.texts) {
    const char* anchor = line.anchor == Drawing::Anchor::kStart ? "start"
                         : line.anchor == Drawing::Anchor::kEnd ? "end"
                                                                : "middle";
    text += fmt::format("text {} {} {} {} {} {}\n", std::lround(line.x), std::lround(line.baseline), line.size, anchor,
                        line.colour, line.line);
  }
  return text;
}

Status check_plot_name(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (path.empty()) return {};
  if (extension != ".svg" && extension != ".png") {
    return Error{Fault::kUsage, fmt::format("--plot {}: plots are SVG or PNG; end the name with .svg or .png", path)};
  }
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  std::error_code ignored;
  if (folder.empty() || std::filesystem::is_directory(folder, ignored)) return {};
  return Error{Fault::kOutput,
               fmt::format("--plot {}: there is no folder {}; make it or choose another place", path, folder.string())};
}

int draw_heights(const std::string& path, const Job&, const Scene& scene, const HeightsStudy& study) {
  const Drawing drawing = draw_study(scene, study);
  if (std::filesystem::path(path).extension() == ".svg") {
    const std::string text = svg_text(drawing);
    const Status status = write::write_file(path, std::as_bytes(std::span(text)));
    return status ? 0 : fail(status.error());
  }
  // The drawing lies beside the picture until lamina-preview has read it; that program removes it.
  const std::string beside = path + ".drawing";
  const std::string text = drawing_text(drawing);
  if (Status status = write::write_file(beside, std::as_bytes(std::span(text))); !status) {
    Error error = status.error();
    if (error.message.starts_with(beside)) error.message.replace(0, beside.size(), path);
    return fail(error);
  }
  return fail(hand_over_to_preview({"--drawing", beside, "-o", path}));
}

}  // namespace lamina::pipeline
