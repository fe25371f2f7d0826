#include "stages/segment/permeability.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stages/support/io/file_reader.h"
#include "stages/support/text/number_text.h"

namespace lamina::segment {

Result<std::vector<FlowPoint>> expanded(std::span<const FlowPoint> points, double length_m, const GasPressures& pressures) {
  std::vector<FlowPoint> gas(points.begin(), points.end());
  for (FlowPoint& point : gas) {
    const double drop = point.gradient_pa_m * length_m, inlet = pressures.outlet_pa + drop;
    if (!(inlet > 0)) {
      return Error{Fault::kInput, fmt::format("a drop of {:.4g} Pa from an outlet at {:.6g} Pa leaves no pressure at the inlet",
                                              drop, pressures.outlet_pa)};
    }
    point.gradient_pa_m *= (inlet + pressures.outlet_pa) / (2 * pressures.reference_pa);
  }
  return gas;
}

Result<Permeability> fit_permeability(std::span<const FlowPoint> points, const Fluid& fluid) {
  if (points.size() < 3) return Error{Fault::kInput, fmt::format("{} points; a fit needs three or more", points.size())};
  // Velocities in units of their largest, so that both columns are of one size.
  double unit = 0, mean = 0;
  for (const FlowPoint& p : points) {
    unit = std::max(unit, std::abs(p.velocity_m_s));
    mean += p.gradient_pa_m;
  }
  mean /= static_cast<double>(points.size());
  if (!(unit > 0)) return Error{Fault::kInput, "all velocities are 0"};
  double s2 = 0, s3 = 0, s4 = 0, t1 = 0, t2 = 0;
  for (const FlowPoint& p : points) {
    const double v = p.velocity_m_s / unit, y = p.gradient_pa_m;
    s2 += v * v;
    s3 += v * v * v;
    s4 += v * v * v * v;
    t1 += v * y;
    t2 += v * v * y;
  }
  const double determinant = s2 * s4 - s3 * s3;
  if (!(determinant > 1e-12 * s2 * s4)) {
    return Error{Fault::kInput,
                 "all points have one velocity; linear and quadratic terms cannot be separated, measure at more flow rates"};
  }
  const double a = (t1 * s4 - t2 * s3) / determinant, b = (t2 * s2 - t1 * s3) / determinant;
  double squares = 0, total = 0;
  for (const FlowPoint& p : points) {
    const double v = p.velocity_m_s / unit, miss = p.gradient_pa_m - a * v - b * v * v;
    squares += miss * miss;
    total += (p.gradient_pa_m - mean) * (p.gradient_pa_m - mean);
  }
  const double variance = squares / static_cast<double>(points.size() - 2);
  Permeability result;
  result.linear = a / unit;
  result.quadratic = b / (unit * unit);
  if (!(result.linear > 0) || !(result.quadratic > 0)) {
    return Error{Fault::kInput,
                 fmt::format("the parabola has a {} part that is not positive ({:.4g}); the flow may be too low or too high "
                             "for this equation, or a column is wrong",
                             result.linear > 0 ? "quadratic" : "linear", result.linear > 0 ? result.quadratic : result.linear)};
  }
  result.k1_m2 = fluid.viscosity_pa_s / result.linear;
  result.k2_m = fluid.density_kg_m3 / result.quadratic;
  result.k1_error_m2 = result.k1_m2 * std::sqrt(variance * s4 / determinant) / a;
  result.k2_error_m = result.k2_m * std::sqrt(variance * s2 / determinant) / b;
  result.r_squared = total > 0 ? 1 - squares / total : 1;
  result.scatter_pa_m = std::sqrt(variance);
  return result;
}

// --- tables of measurements

namespace {

struct Unit {
  std::string_view ending;
  double si;
};
// Longer endings first: "_mbar" also ends in "bar".
constexpr Unit kFlows[] = {{"_l_min", 1e-3 / 60}, {"_ml_min", 1e-6 / 60}, {"_l_h", 1e-3 / 3600},
                           {"_m3_h", 1.0 / 3600}, {"_m3_s", 1},           {"_l_s", 1e-3}};
constexpr Unit kVelocities[] = {{"_mm_s", 1e-3}, {"_cm_s", 1e-2}, {"_m_s", 1}};
constexpr Unit kDrops[] = {{"_mbar", 100}, {"_kpa", 1000}, {"_hpa", 100}, {"_pa", 1}, {"_bar", 1e5}, {"_psi", 6894.757293}};

template <std::size_t N>
double unit_of(std::string name, const Unit (&units)[N]) {
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const Unit& unit : units) {
    if (name.ends_with(unit.ending)) return unit.si;
  }
  return 0;
}

/// What the columns of a table hold.
struct Columns {
  std::vector<std::string> names;
  std::vector<double> drop_units;  // of each; 0: no pressure drop
  std::size_t flow = SIZE_MAX, group = SIZE_MAX, sample = SIZE_MAX;
  double flow_unit = 0;  // SI
  bool velocity = false;

  /// Reads a header. returns "" or what is missing
  std::string read(std::vector<std::string> header) {
    names = std::move(header);
    drop_units.assign(names.size(), 0);
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (names[i] == "configuration") group = i;
      if (names[i] == "sample") sample = i;
      drop_units[i] = unit_of(names[i], kDrops);
      if (drop_units[i] > 0 || flow != SIZE_MAX) continue;
      flow_unit = unit_of(names[i], kFlows);
      velocity = flow_unit == 0;
      if (velocity) flow_unit = unit_of(names[i], kVelocities);
      if (flow_unit > 0) flow = i;
    }
    if (flow == SIZE_MAX) return "no column of flows (flow_l_min, flow_ml_min, flow_m3_s) or velocities (velocity_m_s)";
    if (std::ranges::max(drop_units) > 0) return {};
    return "no column of pressure drops (drop_pa, drop_kpa, drop_mbar, drop_bar, drop_psi)";
  }

  /// The name of the sample that a drop belongs to; "" if it is not known.
  std::string sample_of(const std::vector<std::string>& cells, std::size_t drop) const {
    if (sample != SIZE_MAX) return cells[sample].empty() ? "unnamed" : cells[sample];
    const auto columns = drop_units.size() - static_cast<std::size_t>(std::ranges::count(drop_units, 0.0));
    return columns > 1 ? names[drop].substr(0, names[drop].rfind('_')) : std::string();
  }
};

constexpr std::size_t kMaxSamples = 1000;  // of a group: they are searched one by one

/// The number of a sample within its group.
std::uint32_t number_of(const std::string& sample, FlowGroup& group) {
  if (sample.empty()) return 0;
  auto position = std::ranges::find(group.samples, sample);
  if (position == group.samples.end()) position = group.samples.insert(position, sample);
  return static_cast<std::uint32_t>(position - group.samples.begin());
}

/// Adds the points of a row to its group. returns "" or what is wrong
std::string add_row(const Columns& columns, const std::vector<std::string>& cells, const Medium& medium,
                    std::vector<FlowGroup>& groups) {
  const auto number = [&](std::size_t column, double minimum, double& value) {
    const auto wrong = read_number(cells[column], minimum, 1e12, "", value);
    return wrong.empty() ? wrong : fmt::format("{}: {}", columns.names[column], wrong);
  };
  if (cells.size() != columns.names.size())
    return fmt::format("{} columns where the header has {}", cells.size(), columns.names.size());
  double flow = 0;
  if (const auto wrong = number(columns.flow, 0, flow); !wrong.empty()) return wrong;
  const double velocity = flow * columns.flow_unit / (columns.velocity ? 1 : medium.area_m2);
  const std::string name = columns.group == SIZE_MAX ? std::string() : cells[columns.group];
  auto group = std::ranges::find(groups, name, &FlowGroup::name);
  if (group == groups.end()) group = groups.insert(groups.end(), {name, {}});
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (columns.drop_units[i] == 0 || cells[i].empty()) continue;
    double drop = 0;
    if (const auto wrong = number(i, -1e12, drop); !wrong.empty()) return wrong;
    group->points.push_back(
        {velocity, drop * columns.drop_units[i] / medium.length_m, number_of(columns.sample_of(cells, i), *group)});
    if (group->samples.size() > kMaxSamples) return fmt::format("more than {} samples in one configuration", kMaxSamples);
  }
  return {};
}

constexpr const char *kInk = "000000", *kPale = "dddddd";
constexpr double kPlotLeft = 80, kPlotTop = 50, kPlotWidth = 520, kPlotHeight = 320;

/// Pressure gradients in a unit that keeps their numbers short.
struct GradientUnit {
  double pa_m;
  const char* name;
};
GradientUnit unit_of(double max_pa_m) {
  return max_pa_m >= 1e6 ? GradientUnit{1e6, "MPa/m"} : max_pa_m >= 1e3 ? GradientUnit{1e3, "kPa/m"} : GradientUnit{1, "Pa/m"};
}

/// Grid lines with their numbers, from 0 to the largest value of each axis.
void draw_axes(double max_v, double max_y, const GradientUnit& unit, bool gas, Plot& plot) {
  const double bottom = kPlotTop + kPlotHeight, v_step = tick_step(max_v, 6), y_step = tick_step(max_y / unit.pa_m, 6);
  for (int i = 0; i * v_step <= max_v * (1 + 1e-9); ++i) {
    const double x = kPlotLeft + kPlotWidth * i * v_step / max_v;
    plot.boxes.push_back({x, kPlotTop, 1, kPlotHeight, kPale});
    plot.texts.push_back({x, bottom + 18, 12, Plot::Anchor::kMiddle, kInk, fmt::format("{:.4g}", i * v_step)});
  }
  for (int i = 0; i * y_step * unit.pa_m <= max_y * (1 + 1e-9); ++i) {
    const double y = bottom - kPlotHeight * i * y_step * unit.pa_m / max_y;
    plot.boxes.push_back({kPlotLeft, y, kPlotWidth, 1, kPale});
    plot.texts.push_back({kPlotLeft - 8, y + 4, 12, Plot::Anchor::kEnd, kInk, fmt::format("{:.4g}", i * y_step)});
  }
  plot.lines.push_back({{{kPlotLeft, kPlotTop}, {kPlotLeft, bottom}, {kPlotLeft + kPlotWidth, bottom}}, kInk});
  plot.texts.push_back(
      {kPlotLeft + kPlotWidth / 2, bottom + 40, 13, Plot::Anchor::kMiddle, kInk, "superficial velocity (m/s)"});
  plot.texts.push_back({10, kPlotTop - 10, 13, Plot::Anchor::kStart, kInk,
                        fmt::format("{} ({})", gas ? "(p_in^2 - p_out^2) / (2 p L)" : "pressure drop / length", unit.name)});
}

}  // namespace

Result<std::vector<FlowGroup>> read_flows(const std::string& path, const Medium& medium) {
  auto file = FileReader::open(path, {.fault = Fault::kInput, .max_bytes = kMaxTableBytes, .streams = true});
  if (!file) return file.error();
  Columns columns;
  char separator = ',';
  std::vector<FlowGroup> groups;
  for (std::string_view line; file->next(line);) {
    if (line.empty() || line[0] == '#' || line == "\r") continue;
    const bool header = columns.names.empty();
    if (header) separator = separator_of(line);
    auto cells = cells_of(line, separator);
    const std::string wrong = header ? columns.read(std::move(cells)) : add_row(columns, cells, medium, groups);
    if (!wrong.empty()) return Error{Fault::kInput, fmt::format("{}:{}: {}", path, file->line_number(), wrong)};
  }
  if (!file->status()) return file->status().error();
  if (!groups.empty()) return groups;
  return Error{Fault::kInput,
               path + ": contains no measurements; the first line names the columns, the others contain numbers"};
}

Plot draw_fit(const FlowGroup& group, const Permeability& fit, bool gas) {
  double max_v = 0, max_y = 0;
  for (const auto& p : group.points) {
    max_v = std::max(max_v, p.velocity_m_s);
    max_y = std::max(max_y, p.gradient_pa_m);
  }
  const auto x = [&](double v) { return kPlotLeft + kPlotWidth * v / max_v; };
  const auto y = [&](double g) { return kPlotTop + kPlotHeight - kPlotHeight * g / max_y; };
  Plot plot;
  plot.width = 640;
  plot.height = 430;
  // No axis where nothing flows or no pressure drops.
  if (max_v > 0 && max_y > 0) draw_axes(max_v, max_y, unit_of(max_y), gas, plot);
  auto& curve = plot.lines.emplace_back(Plot::Line{{}, "cc3333"});
  for (int i = 0; i <= 100; ++i) {
    const double v = max_v * i / 100;
    curve.points.push_back({x(v), y(fit.linear * v + fit.quadratic * v * v)});
  }
  for (const auto& p : group.points) plot.dots.push_back({x(p.velocity_m_s), y(p.gradient_pa_m), 2.5, "2266cc"});
  plot.texts.push_back({10, 20, 13, Plot::Anchor::kStart, kInk,
                        fmt::format("{}k1 {:.2f} D, k2 {:.4g} m, R2 {:.5f}", group.name.empty() ? "" : group.name + ": ",
                                    fit.k1_m2 / kDarcy, fit.k2_m, fit.r_squared)});
  return plot;
}

// --- samples

Spread spread_of(const std::vector<double>& values) {
  Spread spread;
  const auto count = static_cast<double>(values.size());
  for (const double value : values) spread.mean += value / count;
  if (values.size() < 2) return spread;
  // In units of the mean: squares of permeabilities in m2 would leave the range of numbers.
  double squares = 0;
  for (const double value : values) squares += (value / spread.mean - 1) * (value / spread.mean - 1);
  spread.deviation = spread.mean * std::sqrt(squares / (count - 1));
  spread.mean_error = spread.deviation / std::sqrt(count);
  return spread;
}

Result<GroupFit> fit_group(const FlowGroup& group, const Fluid& fluid) {
  GroupFit result;
  const Result<Permeability> pooled = fit_permeability(group.points, fluid);
  if (!pooled) return pooled.error();
  result.pooled = *pooled;
  if (group.samples.size() < 2) return result;
  std::vector<std::vector<FlowPoint>> points(group.samples.size());
  for (const FlowPoint& point : group.points) points[point.sample].push_back(point);
  std::vector<double> k1, k2;
  for (std::size_t s = 0; s < points.size(); ++s) {
    const Result<Permeability> fit = fit_permeability(points[s], fluid);
    if (!fit) {
      result.left_out.push_back(group.samples[s] + ": " + fit.error().message);
      continue;
    }
    result.samples.push_back({group.samples[s], points[s].size(), *fit});
    k1.push_back(fit->k1_m2);
    k2.push_back(fit->k2_m);
  }
  if (k1.empty()) return result;
  result.k1_m2 = spread_of(k1);
  result.k2_m = spread_of(k2);
  return result;
}

Result<std::vector<DropsFit>> fit_drops(const std::string& path, const DropsSettings& settings) {
  auto groups = read_flows(path, settings.medium);
  if (!groups) return groups.error();
  std::vector<DropsFit> fits;
  for (FlowGroup& group : *groups) {
    DropsFit& fit = fits.emplace_back();
    fit.group = std::move(group);
    fit.pressures = settings.gas;
    const std::string position = fit.group.name.empty() ? "" : fit.group.name + ": ";
    const auto at = [&](const Error& error) {
      return Error{error.fault, fmt::format("{}: {}{}", path, position, error.message)};
    };
    const auto take = [&](const char* form, Result<GroupFit> found, std::optional<GroupFit>& target) {
      target = std::move(*found);
      for (const std::string& line : target->left_out)
        fit.warnings.push_back(fmt::format("{}{}{}; left out of the mean", position, form, line));
    };
    Result<GroupFit> plain = fit_group(fit.group, settings.fluid);
    if (!plain && !settings.gas) return at(plain.error());
    // Of a gas at large drops the plain parabola may bend the wrong way; that of gases does not.
    if (plain)
      take("", std::move(plain), fit.plain);
    else
      fit.warnings.push_back(fmt::format("{}as if it did not expand: {}", position, plain.error().message));
    if (!settings.gas) continue;
    fit.expanded = fit.group;
    auto points = expanded(fit.group.points, settings.medium.length_m, *settings.gas);
    if (!points) return at(points.error());
    fit.expanded.points = std::move(*points);
    Result<GroupFit> gas = fit_group(fit.expanded, settings.fluid);
    if (!gas) return at(gas.error());
    take("compressible: ", std::move(gas), fit.gas);
  }
  return fits;
}

}  // namespace lamina::segment
