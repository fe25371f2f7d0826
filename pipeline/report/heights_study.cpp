#include "pipeline/report/heights_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "pipeline/report/overhang_observer.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

using heights::Evaluation;
using heights::FlatHit;
using heights::LayerFacts;
using heights::Mode;
using heights::Study;

std::string part_name(const StudiedParts& parts, std::uint32_t part) {
  return part < parts.paths.size() ? std::filesystem::path(parts.paths[part]).filename().string() : "-";
}

// Whether Dolenc and Makela's rule took a layer back because the surface changes above its bottom.
bool stepped_back(const Study& study, std::size_t layer) {
  return !study.plan.stepped_back.empty() && study.plan.stepped_back[layer];
}
std::size_t stepped_back_count(const Study& study) {
  return static_cast<std::size_t>(std::ranges::count(study.plan.stepped_back, true));
}

std::string signed_mm(std::int64_t nm) { return fmt::format("{:+.4f} mm", mm(nm)); }

double rounded(double value, int decimals) {
  const double unit = std::pow(10, decimals);
  return std::round(value * unit) / unit;
}

std::string flats_line(const Study& study) {
  const Evaluation& e = study.evaluation;
  if (e.flats_missed == 0) return fmt::format("{} of {} hit", e.flats.size(), e.flats.size());
  return fmt::format("{} of {} hit, {} missed by up to {:.4f} mm", e.flats.size() - e.flats_missed, e.flats.size(),
                     e.flats_missed, mm(e.largest_miss));
}

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
  Buffer<Triangle> scratch;
  for (const Instance& instance : parts.instances) {
    const Mesh& mesh = parts.meshes[instance.mesh];
    each_listed(mesh, 0, triangle_count(mesh), scratch, [&](std::span<const Triangle> facets) {
      for (const Triangle& t : facets) {
        edge(t.a, t.b, instance.offset);
        edge(t.b, t.c, instance.offset);
        edge(t.c, t.a, instance.offset);
      }
    });
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
                          missed ? fmt::format("{:.3f}: missed by {:.3f}", mm(hit.flat.height), mm(hit.miss))
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
      fmt::format("step up to {:.4f} mm, {:.4f} mm on average; {} of {} horizontal faces hit; top {:+.4f} mm",
                  mm(e.largest_cusp), e.mean_cusp * 1e-6, e.flats.size() - e.flats_missed, e.flats.size(), mm(e.top_miss)));
  double legend = kPlotLeft;
  for (const auto& [reason, name] : {std::pair{LayerReason::kUniform, "thickest"},
                                     {LayerReason::kCusp, "slope"},
                                     {LayerReason::kFlat, "to reach a horizontal face"}}) {
    plot.boxes.push_back({legend, kTop - 20.0, 12, 12, colour_of(reason)});
    put(legend + 17, kTop - 9.0, 14, Plot::Anchor::kStart, name);
    legend += 40 + 8.0 * static_cast<double>(std::string_view(name).size());
  }
  put(kPlotLeft + kHalf / 2, kHeight - 18.0, 15, Plot::Anchor::kMiddle, "layer thickness, mm");
  put(kMiddle, kHeight - 18.0, 15, Plot::Anchor::kMiddle, "front view; height, mm");
}

}  // namespace

std::string text_of(const heights::Settings& settings, double layer_mm) {
  std::string text = fmt::format("of {} mm", settings.thickness_mm.empty() ? number_text(layer_mm) : settings.thickness_mm);
  if (settings.mode == Mode::kUniform) return text;
  text += fmt::format(", {}", mode_name(settings.mode));
  if (settings.mode == Mode::kAngle) return text + fmt::format(", from {} degrees", number_text(settings.adapt_angle_deg));
  return text + fmt::format(", steps up to {} mm", number_text(settings.cusp_mm));
}

std::string small_peaks_text(const heights::Plan& plan, double min_flat_mm2) {
  if (plan.small_peaks == 0) return {};
  return fmt::format(
      "{} with horizontal facets below {} mm2 in all {} no peak{}; --peaks facets counts every one, as Lima (2009) does",
      plan.small_peaks == 1 ? "a height" : fmt::format("{} heights", plan.small_peaks), number_text(min_flat_mm2),
      plan.small_peaks == 1 ? "is" : "are", plan.small_peaks == 1 ? "" : "s");
}

std::string_view reason(const Study& study, std::size_t layer) {
  return study.reasons.empty() ? "given" : reason_name(study.reasons[layer]);
}

double angle(const Study& study, std::size_t layer) {
  return heights::angle_of(study.plan.inspected.empty() ? study.evaluation.layers[layer].flattest
                                                        : study.plan.inspected[layer]);
}

std::string study_page(const StudiedParts& parts, const Study& study) {
  const Evaluation& e = study.evaluation;
  std::string text;
  const auto line = [&](std::string_view name, const std::string& what) { text += fmt::format("{:<10}{}\n", name, what); };
  line("layers", fmt::format("{} {}", readable_count(study.layers()), study.reasons.empty() ? study.name : parts.way));
  line("height", fmt::format("{:.4f} mm, the parts {:.4f} mm ({})", mm(study.boundaries.back()), mm(parts.height),
                             signed_mm(e.top_miss)));
  line("steps", fmt::format("up to {:.4f} mm (layer {}), {:.4f} mm on average over the surface", mm(e.largest_cusp),
                            e.largest_cusp_layer + 1, e.mean_cusp * 1e-6));
  if (e.above_limit > 0 && !study.reasons.empty() && study.options.mode != Mode::kUniform &&
      study.options.mode != Mode::kAngle) {
    line("", fmt::format("{} layers of the minimum thickness have a step above the limit of {} mm; thinner ones would help",
                         e.above_limit, number_text(mm(study.options.cusp))));
  }
  if (const std::size_t back = stepped_back_count(study); back > 0) {
    line("", fmt::format("{} layers are thinner than the slopes at their bottom require: the surface above is flatter", back));
  }
  line("flats", flats_line(study));
  if (const std::string small = small_peaks_text(study.plan, study.options.min_flat_mm2); !small.empty()) line("peaks", small);
  if (study.plan.one_less_reaches >= 0) {
    line("proof", fmt::format("{} that keeps these steps and flats gets higher than {:.4f} mm",
                              study.options.time.on() ? "no table of less time" : "no table of a layer less",
                              mm(study.plan.one_less_reaches)));
  }
  if (study.options.time.on()) line("time", readable_seconds(e.seconds));
  for (const FlatHit& hit : e.flats) {
    text +=
        fmt::format("  flat at {:9.4f} mm  {:10.2f} mm2 up {:10.2f} mm2 down  {}{}\n", mm(hit.flat.height), hit.flat.up_mm2,
                    hit.flat.down_mm2,
                    hit.miss > study.options.surface.flat_tolerance ? fmt::format("missed by {:.4f} mm", mm(hit.miss)) : "hit",
                    hit.flat.end ? ", end of a part" : "");
  }
  text += fmt::format("\n{:>6} {:>10} {:>9}  {:<8} {:>6} {:>8}  {}\n", "layer", "bottom", "thickness", "reason", "angle",
                      "step", "decided by");
  for (std::size_t i = 0; i < study.layers(); ++i) {
    text += fmt::format("{:>6} {:>10.4f} {:>9.4f}  {:<8} {:>6.2f} {:>8.4f}  {}\n", i + 1, mm(study.boundaries[i]),
                        mm(study.thickness(i)), reason(study, i), angle(study, i), mm(e.layers[i].cusp),
                        part_name(parts, e.layers[i].part));
  }
  return text;
}

std::string study_csv(const StudiedParts& parts, const std::vector<Study>& studies) {
  std::string text = "table,layer,bottom_mm,thickness_mm,reason,angle_deg,cusp_mm,hits_flat,stepped_back,part\n";
  const auto quoted = [](std::string name) {
    for (std::size_t at = 0; (at = name.find('"', at)) != std::string::npos; at += 2) name.insert(at, 1, '"');
    return '"' + name + '"';
  };
  for (const Study& study : studies) {
    for (std::size_t i = 0; i < study.layers(); ++i) {
      const LayerFacts& layer = study.evaluation.layers[i];
      text += fmt::format("{},{},{:.6f},{:.6f},{},{:.2f},{:.6f},{},{},{}\n", quoted(study.name), i + 1, mm(study.boundaries[i]),
                          mm(study.thickness(i)), reason(study, i), angle(study, i), mm(layer.cusp), layer.hits_flat ? 1 : 0,
                          stepped_back(study, i) ? 1 : 0, quoted(part_name(parts, layer.part)));
    }
  }
  return text;
}

std::string study_json(const StudiedParts& parts, const std::vector<Study>& studies) {
  Json all = {{"height_mm", mm(parts.height)}, {"parts", Json::array()}, {"cusp_limit_mm", parts.cusp_limit_mm}};
  for (const std::string& path : parts.paths) all["parts"].push_back(path);
  for (const Study& study : studies) {
    const Evaluation& e = study.evaluation;
    Json table = {{"name", study.name},
                  {"layers", study.layers()},
                  {"top_mm", mm(study.boundaries.back())},
                  {"top_miss_mm", mm(e.top_miss)},
                  {"largest_cusp_mm", mm(e.largest_cusp)},
                  {"mean_cusp_mm", rounded(e.mean_cusp * 1e-6, 6)},
                  {"layers_above_limit", e.above_limit},
                  {"flats", e.flats.size()},
                  {"flats_missed", e.flats_missed},
                  {"largest_miss_mm", mm(e.largest_miss)}};
    if (study.plan.small_peaks > 0) table["small_peaks"] = study.plan.small_peaks;
    if (study.plan.one_less_reaches >= 0) table["one_less_reaches_mm"] = mm(study.plan.one_less_reaches);
    if (!parts.overhangs.empty())
      table["overhangs"] = overhangs_json(parts.overhangs[all["tables"].size()], parts.support_angle_deg);
    if (e.seconds > 0) table["seconds"] = rounded(e.seconds, 3);
    table["flat"] = Json::array();
    table["layer"] = Json::array();
    for (const FlatHit& hit : e.flats) {
      table["flat"].push_back({{"height_mm", mm(hit.flat.height)},
                               {"up_mm2", rounded(hit.flat.up_mm2, 4)},
                               {"down_mm2", rounded(hit.flat.down_mm2, 4)},
                               {"end", hit.flat.end},
                               {"miss_mm", mm(hit.miss)}});
    }
    for (std::size_t i = 0; i < study.layers(); ++i) {
      const LayerFacts& layer = e.layers[i];
      table["layer"].push_back({{"bottom_mm", mm(study.boundaries[i])},
                                {"thickness_mm", mm(study.thickness(i))},
                                {"reason", reason(study, i)},
                                {"angle_deg", rounded(angle(study, i), 2)},
                                {"cusp_mm", mm(layer.cusp)},
                                {"hits_flat", layer.hits_flat},
                                {"stepped_back", stepped_back(study, i)},
                                {"part", layer.part < parts.paths.size() ? Json(layer.part) : Json()}});
    }
    all["tables"].push_back(std::move(table));
  }
  return json_line(all);
}

std::string comparison_page(const StudiedParts& parts, const std::vector<Study>& studies) {
  const Study& first = studies.front();
  const double whole = first.evaluation.seconds;
  const bool saves = first.options.estimates_time;  // in addition to the first
  std::string text =
      fmt::format("{:<24} {:>7} {:>12} {:>10} {:>12} {:>12} {:>10}{}{}\n", "way", "layers", "largest step", "mean step",
                  "flats missed", "largest miss", "top", parts.overhangs.empty() ? "" : "    overhangs",
                  saves       ? "        time    saved"
                  : whole > 0 ? "        time"
                              : "");
  for (const Study& study : studies) {
    const Evaluation& e = study.evaluation;
    text += fmt::format("{:<24} {:>7} {:>9.4f} mm {:>7.4f} mm {:>12} {:>9.4f} mm {:>+7.3f} mm", study.name, study.layers(),
                        mm(e.largest_cusp), e.mean_cusp * 1e-6, fmt::format("{} of {}", e.flats_missed, e.flats.size()),
                        mm(e.largest_miss), mm(e.top_miss));
    if (!parts.overhangs.empty()) {
      text += fmt::format(" {:>8.1f} mm2", parts.overhangs[static_cast<std::size_t>(&study - studies.data())].area_mm2());
    }
    if (whole > 0) text += fmt::format(" {:>11}", readable_seconds(e.seconds));
    if (saves) text += fmt::format(" {:>6.1f} %", 100 * (1 - e.seconds / whole));
    text += '\n';
  }
  if (saves) {
    const heights::TimeModel& time = first.options.time.on() ? first.options.time : heights::kPlainTime;
    text += fmt::format("time: {:g} s a layer and {:g} s a mm2 of its section{}; saved: compared with {}\n",
                        time.seconds_per_layer, time.seconds_per_mm2,
                        first.options.time.on() ? "" : ", as beads of 0.4 mm at 40 mm/s fill it; --time-model S,S for others",
                        first.name);
  }
  return text;
}

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
