#include "stages/chart/measured.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "stages/data/text/json.h"

namespace lamina::chart {
namespace {

std::string list_of(const std::vector<std::uint32_t>& nozzles) {
  return nozzles.empty() ? "none" : fmt::format("{}", fmt::join(nozzles, ", "));
}

/// A nozzle of a later row that lands too far along the scan stands less far behind than the profile says.
std::string correct_rows(const Json& nozzles, Machine& machine) {
  std::vector<double>& rows = machine.head.row_offset_um;
  std::vector<double> sum(rows.size(), 0), count(rows.size(), 0);
  for (std::size_t n = 0; n < nozzles.size(); ++n) {
    if (nozzles[n].is_null()) continue;
    sum[n % rows.size()] += nozzles[n].at("along_um").get<double>();
    ++count[n % rows.size()];
  }
  std::string line;
  for (std::size_t r = 1; r < rows.size(); ++r) {
    if (count[r] == 0 || count[0] == 0) continue;
    const double late = std::round(sum[r] / count[r] - sum[0] / count[0]);
    rows[r] -= late;
    line += fmt::format("{}{:+g} um", line.empty() ? "rows      against the first one, changed by " : ", ", -late);
  }
  return line;
}

std::vector<std::string> swath_lines(const Json& swaths) {
  std::vector<std::string> lines;
  for (std::size_t s = 0; s < swaths.size(); ++s) {
    if (swaths[s].is_null()) {
      lines.push_back(fmt::format("swath {}   was not printed", s));
    } else if (s > 0) {
      lines.push_back(fmt::format("swath {}   {:+.0f} um across, {:+.0f} um along the scan against the first one", s,
                                  swaths[s].at("across_um").get<double>(), swaths[s].at("along_um").get<double>()));
    }
  }
  return lines;
}

std::vector<std::string> take(const Json& json, Machine& machine) {
  const auto seen_blocked = json.at("blocked").get<std::vector<std::uint32_t>>();
  const auto weak = json.at("weak").get<std::vector<std::uint32_t>>(),
             untold = json.at("untold").get<std::vector<std::uint32_t>>();
  const Json& nozzles = json.at("nozzles");
  // Blocked stay those that were not on the chart, and those of which nothing could be seen.
  std::set<std::uint32_t> blocked(seen_blocked.begin(), seen_blocked.end());
  for (const std::uint32_t n : machine.head.blocked) {
    if (n < nozzles.size() && nozzles[n].is_null()) blocked.insert(n);
  }
  std::vector<std::string> lines;
  lines.push_back(fmt::format("photo     {:.1f} pixels a mm, dashes within {:.0f} um of their places",
                              json.at("pixels_a_mm").get<double>(), json.at("scatter_um").get<double>()));
  machine.head.blocked.assign(blocked.begin(), blocked.end());
  lines.push_back("blocked   " + list_of(machine.head.blocked));
  if (!weak.empty()) lines.push_back(fmt::format("weak      {}: seen by times, not taken for blocked", list_of(weak)));
  if (!untold.empty()) lines.push_back("unknown   " + list_of(untold) + ": nothing of theirs can be seen");
  if (auto rows = correct_rows(nozzles, machine); !rows.empty()) lines.push_back(std::move(rows));
  for (std::string& line : swath_lines(json.at("swaths"))) lines.push_back(std::move(line));
  if (const auto gain = json.find("dot_gain_um"); gain != json.end()) {
    const double along = gain->at("along").get<double>(), across = gain->at("across").get<double>();
    const bool along_x = machine.mounting.scan_axis == ScanAxis::kX;
    const std::array<double, 2> um{std::round(along_x ? along : across), std::round(along_x ? across : along)};
    lines.push_back(
        fmt::format("gain      edges stand out by {:g} um along x, {:g} um along y: take it off with --bleed {:g}x{:g}", um[0],
                    um[1], std::max(um[0], 0.0), std::max(um[1], 0.0)));
    machine.head.dot_gain_um = um;
  }
  for (const Json& wedge : json.at("wedges"))
    lines.push_back(fmt::format("wedge     {:g} % of the pixels: {:.0f} % of full ink",
                                wedge.at("pixels_percent").get<double>(), wedge.at("seen_percent").get<double>()));
  return lines;
}

}  // namespace

Result<std::vector<std::string>> take_over(std::string_view reading, Machine& machine) {
  try {
    return take(Json::parse(reading), machine);
  } catch (const std::exception& error) {
    return Error{Fault::kInternal, std::string("lamina-scan told what is no reading: ") + error.what()};
  }
}

}  // namespace lamina::chart
