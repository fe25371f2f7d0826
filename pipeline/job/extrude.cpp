// Section [extrude].
#include "pipeline/job/extrude.h"

#include <algorithm>

#include "pipeline/job/keys.h"

namespace lamina::pipeline {
namespace {

using Changes = std::vector<std::pair<std::string, std::string>>;

/// Keys of a profile with their section: { fan = { from_layer = 2 } }, or fan.from_layer = 2.
std::string read_machine_tree(const TomlValue& table, Changes& changes, Place& at) {
  if (!table.is_table()) return "is a table of keys of the machine's profile, as in fan.from_layer = 2";
  Changes read;
  for (std::size_t s = 0; s < table.value.size(); ++s) {
    at = table.value[s].place;
    if (!table.value[s].is_table()) return fmt::format("{}: is not section.key, as in fan.from_layer = 2", table.name[s]);
    for (std::size_t i = 0; i < table.value[s].value.size(); ++i) {
      at = table.value[s].value[i].place;
      const std::string name = fmt::format("{}.{}", table.name[s], table.value[s].name[i]);
      const auto text = flat_text(table.value[s].value[i]);
      if (!text) return fmt::format("{}: is not a single value or a list of them", name);
      read.emplace_back(name, *text);
    }
  }
  changes = std::move(read);
  return {};
}

/// The same as an option: "fan.from_layer=2; bed.corner_mm=-110,-110".
std::string read_machine_text(std::string_view text, Changes& changes) {
  if (text.starts_with('{')) {
    Place unused;
    const auto table = read_toml_value(text);
    return table ? read_machine_tree(*table, changes, unused) : "is no table";
  }
  Changes read;
  for (std::string_view change : split(text, ";")) {
    change = trimmed(change);
    if (change.empty()) continue;
    const std::size_t equals = change.find('='), dot = change.find('.');
    if (equals == std::string_view::npos || dot > equals) return fmt::format("'{}' is not section.key=value", change);
    read.emplace_back(change.substr(0, equals), change.substr(equals + 1));
  }
  std::ranges::stable_sort(read, {}, &Changes::value_type::first);  // as a table is read: the same job is the same text
  changes = std::move(read);
  return {};
}

std::string machine_changes_text(const Changes& changes) {
  std::string text;
  for (const auto& [name, value] : changes) text += fmt::format("{}{} = {}", text.empty() ? "" : ", ", name, toml_text(value));
  return text.empty() ? text : fmt::format("{{ {} }}", text);
}

JobKey machine_key() {
  JobKey key = structure<read_machine_tree, machine_changes_text, &Job::extrude, &ExtrudeRequest::machine>(
      {"extrude", "machine", "--machine-set", "KEY=VALUE;...", "other keys of the machine's profile, as in fan.from_layer=2",
       decides::moves});
  key.read_text = [](const JobKey&, std::string_view text, Job& job) { return read_machine_text(text, job.extrude.machine); };
  key.read_tree = [](const JobKey&, const TomlValue& tree, Job& job, Place& at) {
    return tree.is_text() ? read_machine_text(tree.text, job.extrude.machine)
                          : read_machine_tree(tree, job.extrude.machine, at);
  };
  return key;
}

template <auto Member>
JobKey number(std::string_view name, std::string_view flag, std::string_view unit, double low, double high,
              std::string_view meaning) {
  return field<&Job::extrude, Member>({"extrude", name, flag, unit, meaning, decides::moves}, {low, high});
}

}  // namespace

std::span<const JobKey> extrude_keys() {
  using Request = ExtrudeRequest;
  static const JobKey keys[] = {
      number<&Request::flow>("flow", "--flow", "FACTOR", 0.01, 10, "factor on all that is extruded"),
      number<&Request::nozzle_degc>("nozzle_degc", "--nozzle-temperature", "DEGC", 0, 600, "of all layers"),
      number<&Request::bed_degc>("bed_degc", "--bed-temperature", "DEGC", 0, 300, "of all layers"),
      number<&Request::print_mm_s>("print_mm_s", "--print-speed", "MM/S", 0.1, 2000,
                                   "of filling lines; 100 % of segmented ones"),
      number<&Request::wall_mm_s>("wall_mm_s", "--wall-speed", "MM/S", 0.1, 2000, "of walls"),
      number<&Request::first_layer_mm_s>("first_layer_mm_s", "--first-layer-speed", "MM/S", 0.1, 2000,
                                         "nothing of the first layer is laid faster"),
      number<&Request::travel_mm_s>("travel_mm_s", "--travel-speed", "MM/S", 0.1, 2000, "of moves without a bead"),
      number<&Request::retraction_mm>("retraction_mm", "--retraction", "MM", 0, 50, "of filament, before long travels"),
      number<&Request::fan_percent>("fan_percent", "--fan", "%", 0, 100, "of the part's fan"),
      field<&Job::extrude, &Request::relative_extrusion>({"extrude", "relative_extrusion", "--relative-extrusion", "true|false",
                                                          "count filament from move to move", decides::moves}),
      machine_key()};
  return keys;
}

}  // namespace lamina::pipeline
