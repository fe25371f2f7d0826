#include "pipeline/command_keys.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/job_toml.h"

namespace lamina::pipeline {
namespace {

// The heading of the help under which the options of a section stand.
std::string_view heading(std::string_view section) {
  if (section == "part" || section == "place") return "Parts";
  if (section == "slice") return "Contours and files";
  if (section == "fill") return "Filling";
  if (section == "machine" || section == "dose") return "Machine and binder";
  if (section == "load") return "Repair";
  if (section == "run") return "Run";
  return "Bed and layers";
}

template <class Target>
void add_options(std::span<const Key<Target>> keys, const KeyChoice& choice, const Target& presets, CommandSpec& spec) {
  for (const Key<Target>& key : keys) {
    if (key.flag.empty() || !choice.has(key.section, key.name)) continue;
    std::string preset = key.value.empty() ? std::string() : key.write(presets);
    if (key.section == "bed") std::ranges::replace(preset, ',', 'x');
    spec.options.push_back({std::string(key.flag), std::string(key.value), std::string(key.meaning), preset,
                            std::string(heading(key.section))});
  }
}

Error at_option(std::string_view flag, const std::string& what) {
  return {Fault::kUsage, fmt::format("{}: {}", flag.substr(flag.rfind(',') + 1), what)};
}

}  // namespace

bool KeyChoice::has(std::string_view section, std::string_view name) const {
  return std::ranges::any_of(names_, [&](std::string_view chosen) {
    return chosen == section || (chosen.size() == section.size() + 1 + name.size() && chosen.starts_with(section) &&
                                 chosen[section.size()] == '.' && chosen.ends_with(name));
  });
}

void add_key_options(const KeyChoice& choice, CommandSpec& spec) {
  spec.options.insert(
      spec.options.end(),
      {{"--job", "FILE", "a TOML job; options override what it says", "", "Job"},
       {"--save-job", "FILE", "write the job as resolved, to be run again with --job", "", "Job"},
       {"--set", "KEY=VALUE", "set any key of the job, as in --set bed.dpi=600; part.2.copies is of part 2", "", "Job"}});
  add_options<Job>(job_keys(), choice, Job(), spec);
  add_options<PartRequest>(part_keys(), choice, PartRequest(), spec);
}

Result<Job> read_job_options(const KeyChoice& choice, const Arguments& arguments) {
  Job job;
  if (arguments.has("--job")) {
    if (Status status = read_job(arguments.text("--job"), job); !status) return status.error();
  }
  if (!arguments.operands.empty()) {
    job.parts.clear();
    for (const std::string& path : arguments.operands) {
      job.parts.emplace_back();
      job.parts.back().path = path;
    }
  }
  for (const std::string& assignment : arguments.all("--set")) {
    if (Status status = set_key(job, assignment); !status) return status.error();
  }
  for (const JobKey& key : job_keys()) {
    if (key.flag.empty() || !choice.has(key.section, key.name) || !arguments.has(key.flag)) continue;
    const std::string text = key.value.empty() ? std::string(key.switch_text) : arguments.text(key.flag);
    if (const std::string wrong = key.read(text, job); !wrong.empty()) return at_option(key.flag, wrong);
  }
  for (const PartKey& key : part_keys()) {
    if (key.flag.empty() || !choice.has(key.section, key.name) || !arguments.has(key.flag)) continue;
    if (key.flag == "--at" && job.parts.size() > 1) {
      return at_option(key.flag, fmt::format("is for a single part, here are {}; set at_mm of each [[part]] in a job file",
                                             job.parts.size()));
    }
    PartRequest unused;
    if (const std::string wrong = key.read(arguments.text(key.flag), unused); !wrong.empty()) {
      return at_option(key.flag, wrong);
    }
    for (PartRequest& part : job.parts) key.read(arguments.text(key.flag), part);
  }
  return job;
}

}  // namespace lamina::pipeline
