#include "pipeline/report/timing.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "stages/support/text/readable.h"

namespace lamina::pipeline {
Elapsed Timing::whole() const {
  Elapsed all;
  for (const TimedPhase& phase : phases) all.wall += phase.took.wall, all.processor += phase.took.processor;
  return all;
}

double serial_share(const Elapsed& took, std::uint32_t threads) {
  if (threads < 2 || took.wall <= 0) return 0;
  const double n = threads;
  return std::clamp((n * took.wall - took.processor) / ((n - 1) * took.wall), 0.0, 1.0);
}

Lines timing_lines(const Timing& timing) {
  Lines lines;
  const auto add = [&](std::string text) { lines.emplace_back(lines.empty() ? "timing" : "", std::move(text)); };
  add(fmt::format("{:<12}{:>10}{:>14}{:>16}", "phase", "wall, s", "processor, s", "one thread only"));
  const auto phase_line = [&](std::string_view name, const Elapsed& span) {
    add(fmt::format("{:<12}{:>10.4f}{:>14.4f}{:>14.0f} %", name, span.wall, span.processor,
                    100 * serial_share(span, timing.threads)));
  };
  for (const auto& [name, span] : timing.phases) phase_line(name, span);
  phase_line("all", timing.whole());
  add(fmt::format("{:<12}{:>10}{:>14}", "node", "busy, s", "processor, s"));
  for (const auto& [name, busy] : timing.nodes) add(fmt::format("{:<12}{:>10.4f}{:>14.4f}", name, busy.wall, busy.processor));
  if (!timing.floor) return lines;
  const formats::Floor& floor = *timing.floor;
  if (!timing.not_measured.empty()) {
    add("limit       not measured: " + timing.not_measured);
    return lines;
  }
  add(fmt::format("limit       {:>10.4f} on one thread: read {} {:.4f}, write {} in {} files {:.4f}, touch {} crossings {:.4f}",
                  floor.seconds(), readable_bytes(floor.bytes_read), floor.read, readable_bytes(floor.bytes_written),
                  readable_count(floor.files), floor.write, readable_count(floor.crossings), floor.touch));
  if (floor.seconds() > 0)
    add(fmt::format("{:<12}{:>10.1f} times the limit", "this run", timing.whole().wall / floor.seconds()));
  return lines;
}

Json timing_json(const Timing& timing) {
  Json phases = Json::object(), nodes = Json::object();
  for (const auto& [name, span] : timing.phases) {
    phases[std::string(name)] = {{"wall_seconds", span.wall},
                                 {"processor_seconds", span.processor},
                                 {"serial_share", serial_share(span, timing.threads)}};
  }
  for (const auto& [name, busy] : timing.nodes) {
    nodes[std::string(name)] = {{"busy_seconds", busy.wall}, {"processor_seconds", busy.processor}};
  }
  Json json = {{"threads", timing.threads}, {"phases", phases}, {"nodes", nodes}};
  if (!timing.floor) return json;
  const formats::Floor& floor = *timing.floor;
  Json limit = {{"read_bytes", floor.bytes_read}, {"read_seconds", floor.read},   {"write_bytes", floor.bytes_written},
                {"write_files", floor.files},     {"write_seconds", floor.write}, {"crossings", floor.crossings},
                {"touch_seconds", floor.touch},   {"seconds", floor.seconds()}};
  if (!timing.not_measured.empty()) {
    limit = Json::object();
    limit["not_measured"] = timing.not_measured;
  }
  json["limit"] = std::move(limit);
  return json;
}

}  // namespace lamina::pipeline
