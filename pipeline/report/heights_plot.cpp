#include "pipeline/report/heights_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stages/data/plot.h"

namespace lamina::pipeline {
namespace {

using heights::Evaluation;
using heights::FlatHit;
using heights::Study;

constexpr int kWidth = 1200, kHeight = 900, kTop = 96, kBottom = 70, kLeft = 80, kGap = 90, kRight = 150;
constexpr int kPlotHeight = kHeight - kTop - kBottom;
constexpr double kHalf = (kWidth - kLeft - kGap - kRight) / 2.0;  // of the outline, and of the plot
constexpr double kMiddle = kLeft + kHalf / 2, kPlotLeft = kLeft + kHalf + kGap;
constexpr const char* kInk = "333333";
constexpr const char* kPale = "dddddd";

struct Parts {
  std::span<const Mesh> meshes;
  std::span<const Instance> instances;
  Box around;  // all of them
};

const char* colour_of(LayerReason reason) {
  switch (reason) {
    case LayerReason::kSlope:
    case LayerReason::kCusp: return "d9822b";
    case LayerReason::kPeak:
    case LayerReason::kFlat: return "3f8f5f";
    default: return "4a78b5";
  }
}

/// From where to where the parts reach in x, for each of `rows` rows from the bed up; first > second where there is none.
std::vector<std::pair<double, double>> outline(const Parts& parts, double top_nm, int rows) {
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
  for (const Instance& instance : parts.instances) {
    for (const Triangle& t : parts.meshes[instance.mesh].triangles) {
      edge(t.a, t.b, instance.offset);
      edge(t.b, t.c, instance.offset);
      edge(t.c, t.a, instance.offset);
    }
  }
  return reach;
}

double y_of(double nm, double top_nm) { return kTop + kPlotHeight * (1 - nm / top_nm); }

/// The parts from the front. They keep their proportions unless they are too wide.
void draw_outline(const Parts& parts, double top_nm, Plot& plot) {
  const double scale =
      std::min(kPlotHeight / top_nm, kHalf / static_cast<double>(std::max<std::int64_t>(parts.around.width(), 1)));
  const double x_middle = 0.5 * (static_cast<double>(parts.around.lo.x) + parts.around.hi.x);
  const auto reach = outline(parts, top_nm, kPlotHeight);
  for (int row = 0; row < kPlotHeight; ++row) {
    const auto [low, high] = reach[static_cast<std::size_t>(row)];
    if (low > high) continue;
    plot.boxes.push_back({kMiddle + (low - x_middle) * scale, static_cast<double>(kTop + kPlotHeight - 1 - row),
                          std::max(1.0, (high - low) * scale), 1, "b9c3cf"});
  }
}

/// The thickness of each layer at its height, and the ticks of both axes.
void draw_layers(const Study& study, double top_nm, Plot& plot) {
  const std::vector<std::int64_t>& boundaries = study.boundaries;
  const std::size_t layers = study.layers();
  std::int64_t thickest = 0;
  for (std::size_t i = 0; i < layers; ++i) thickest = std::max(thickest, study.thickness(i));
  const double scale = kHalf / (static_cast<double>(thickest) * 1.05);
  const double t_step = tick_step(mm(thickest), 6), z_step = tick_step(top_nm * 1e-6, 12);
  for (double t = 0; t * 1e6 * scale <= kHalf; t += t_step) {
    const double x = kPlotLeft + t * 1e6 * scale;
    plot.boxes.push_back({x, kTop, 1, kPlotHeight, kPale});
    plot.texts.push_back({x, kTop + kPlotHeight + 20.0, 14, Plot::Anchor::kMiddle, kInk, fmt::format("{:.4g}", t)});
  }
  for (double z = 0; z * 1e6 <= top_nm; z += z_step) {
    const double y = y_of(z * 1e6, top_nm);
    plot.boxes.push_back({kLeft - 6.0, y, 6, 1, kInk});
    plot.texts.push_back({kLeft - 10.0, y + 5, 14, Plot::Anchor::kEnd, kInk, fmt::format("{:.4g}", z)});
  }
  // Equal neighbours are one box.
  for (std::size_t first = 0, last = 0; first < layers; first = last) {
    const std::int64_t thickness = study.thickness(first);
    const auto reason = [&](std::size_t i) { return study.reasons.empty() ? LayerReason::kUniform : study.reasons[i]; };
    while (last < layers && study.thickness(last) == thickness && reason(last) == reason(first)) ++last;
    const double top = y_of(static_cast<double>(boundaries[last]), top_nm),
                 bottom = y_of(static_cast<double>(boundaries[first]), top_nm);
    plot.boxes.push_back({kPlotLeft, top, static_cast<double>(thickness) * scale, bottom - top, colour_of(reason(first))});
  }
}

/// A line across both at each flat.
void draw_flats(const Study& study, double top_nm, Plot& plot) {
  double last_label = 1e9;
  for (const FlatHit& hit : study.evaluation.flats) {
    const bool missed = hit.miss > study.options.surface.flat_tolerance;
    const char* colour = missed ? "c62f2f" : "1d5c36";
    const double y = y_of(static_cast<double>(hit.flat.height), top_nm);
    plot.boxes.push_back({static_cast<double>(kLeft), y, kWidth - kRight - static_cast<double>(kLeft), 1, colour});
    if (last_label - y < 15) continue;
    last_label = y;
    plot.texts.push_back({kWidth - kRight + 6.0, y + 5, 13, Plot::Anchor::kStart, colour,
                          missed ? fmt::format("{:.3f}: off {:.3f}", mm(hit.flat.height), mm(hit.miss))
                                 : fmt::format("{:.3f}", mm(hit.flat.height))});
  }
}

void draw_words(const std::string& title, const Study& study, Plot& plot) {
  const auto put = [&](double x, double y, int size, Plot::Anchor anchor, std::string line) {
    plot.texts.push_back({x, y, size, anchor, kInk, std::move(line)});
  };
  const Evaluation& e = study.evaluation;
  put(kLeft, 34, 20, Plot::Anchor::kStart, fmt::format("{}: {} layers, {}", title, study.layers(), study.name));
  put(kLeft, 60, 15, Plot::Anchor::kStart,
      fmt::format("step up to {:.4f} mm, {:.4f} mm on average; {} of {} flats hit; top {:+.4f} mm", mm(e.largest_cusp),
                  e.mean_cusp * 1e-6, e.flats.size() - e.flats_missed, e.flats.size(), mm(e.top_miss)));
  double legend = kPlotLeft;
  for (const auto& [reason, name] :
       {std::pair{LayerReason::kUniform, "thickest"}, {LayerReason::kCusp, "slope"}, {LayerReason::kFlat, "to meet a flat"}}) {
    plot.boxes.push_back({legend, kTop - 20.0, 12, 12, colour_of(reason)});
    put(legend + 17, kTop - 9.0, 14, Plot::Anchor::kStart, name);
    legend += 40 + 8.0 * static_cast<double>(std::string_view(name).size());
  }
  put(kPlotLeft + kHalf / 2, kHeight - 18.0, 15, Plot::Anchor::kMiddle, "thickness of the layer, mm");
  put(kMiddle, kHeight - 18.0, 15, Plot::Anchor::kMiddle, "outline from the front; height, mm");
}

}  // namespace

Plot draw_study(const std::string& title, std::span<const Mesh> meshes, std::span<const Instance> instances,
                const Study& study) {
  Plot plot;
  plot.width = kWidth;
  plot.height = kHeight;
  Parts parts{meshes, instances, {}};
  for (const Instance& instance : instances) {
    const Box& box = meshes[instance.mesh].bounds;
    parts.around.add(Point3{box.lo.x + instance.offset.x, box.lo.y + instance.offset.y, box.lo.z + instance.offset.z});
    parts.around.add(Point3{box.hi.x + instance.offset.x, box.hi.y + instance.offset.y, box.hi.z + instance.offset.z});
  }
  const auto top_nm = static_cast<double>(std::max<std::int64_t>(study.boundaries.back(), parts.around.hi.z));
  draw_outline(parts, top_nm, plot);
  draw_layers(study, top_nm, plot);
  draw_flats(study, top_nm, plot);
  draw_words(title, study, plot);
  return plot;
}

}  // namespace lamina::pipeline
