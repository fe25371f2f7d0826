// Section [extrude].
#include "pipeline/job/job.h"

#include "pipeline/job/keys.h"
#include "pipeline/job/profiles/changes.h"

namespace lamina::pipeline {
namespace {

std::string read_machine_changes(const TomlValue& tree, read::ProfileChanges& changes, Place& at) {
  return tree.is_text() ? read::read_changes(tree.text, changes) : read::read_changes(tree, changes, at);
}

JobKey machine_key() {
  JobKey key = structure<read_machine_changes, read::changes_text, &Job::extrude, &ExtrudeRequest::machine>(
      {"extrude", "machine", "--machine-set", "KEY=VALUE;...", "other keys of the machine's profile, as in fan.from_layer=2",
       decides::moves});
  key.read_text = [](const JobKey&, std::string_view text, Job& job) { return read::read_changes(text, job.extrude.machine); };
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
                                         "nothing of the first layer is laid faster, but thin stretches by their share"),
      number<&Request::travel_mm_s>("travel_mm_s", "--travel-speed", "MM/S", 0.1, 2000, "of moves without a bead"),
      number<&Request::retraction_mm>("retraction_mm", "--retraction", "MM", 0, 50, "of filament, before long travels"),
      number<&Request::fan_percent>("fan_percent", "--fan", "%", 0, 100, "of the part's fan"),
      field<&Job::extrude, &Request::relative_extrusion>({"extrude", "relative_extrusion", "--relative-extrusion", "true|false",
                                                          "count filament from move to move", decides::moves})
          .with_words([] {
            return std::vector<std::string_view>{"true", "false"};
          }),
      field<&Job::extrude, &Request::skirt_loops>(
          {"extrude", "skirt_loops", "--skirt", "N", "loops around all parts before the first bead; 0: none", decides::moves},
          {0, 100}),
      machine_key()};
  return keys;
}

}  // namespace lamina::pipeline
