#include "pipeline/cli/keys.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/cli/outputs.h"
#include "pipeline/job/file.h"

namespace lamina::pipeline {
namespace {

/// The help headings for the options of a section; default "Bed and layers".
constexpr Word<std::string_view> kHeadings[] = {{"part", "Parts"},
                                                {"placement", "Parts"},
                                                {"slice", "Contours and files"},
                                                {"fill", "Filling"},
                                                {"segment", "Segmented lines"},
                                                {"extrude", "Extrusion"},
                                                {"machine", "Machine and binder"},
                                                {"dose", "Machine and binder"},
                                                {"load", "Repair"},
                                                {"run", "Run"}};

template <class Target>
void add_options(std::span<const Key<Target>> keys, const KeyChoice& choice, const Target& presets, CommandSpec& spec) {
  for (const Key<Target>& key : keys) {
    if (key.flag.empty() || !choice.has(key.section, key.name)) continue;
    std::string preset = key.value.empty() ? std::string() : key.write(presets);
    if (key.section == "bed") std::ranges::replace(preset, ',', 'x');
    const auto words = key.words == nullptr ? std::vector<std::string_view>() : key.words();
    // Files may keep an older word for the default.
    if (!preset.empty() && !words.empty() && std::ranges::find(words, preset) == words.end()) preset = words.front();
    std::string_view heading = "Bed and layers";
    read_word(kHeadings, key.section, heading);
    spec.options.push_back(
        {std::string(key.flag), std::string(key.value), std::string(key.meaning), preset, std::string(heading), words});
  }
}

/// Mutually exclusive options.
Status check_together(const KeyChoice& choice, const Arguments& arguments, const Job& job) {
  const std::string fill = arguments.text("--fill"), pattern = arguments.text("--pattern");
  if (choice.has("segment", "fill") && !fill.empty() && !pattern.empty() && fill != pattern && fill != "segmented") {
    return at_option("--fill", fmt::format("{}, but --pattern {}: two patterns; give one of them", fill, pattern));
  }
  if (pattern == "none" && job.segment.all.on) {
    return at_option("--pattern", "none, but lines are segmented; leave it out, or add --fill none");
  }
  if (job.segment.any()) return {};
  for (const JobKey& key : job_keys()) {
    if (key.section != "segment" || key.name == "fill" || key.name == "on" || key.flag.empty()) continue;
    if (choice.has(key.section, key.name) && arguments.has(key.flag)) {
      return at_option(key.flag, "is of segmented lines, and nothing is segmented; add --fill segmented");
    }
  }
  return {};
}

// Errors in the parts of a job file include their place in the file.
Status check_parts_of_file(const std::string& file, const Job& job) {
  if (job.parts.empty()) {
    return Error{Fault::kUsage,
                 fmt::format("{}: no part to plan; add a [[part]] with its path, or name parts on the command line", file)};
  }
  for (const PartRequest& part : job.parts) {
    std::error_code error;
    if (part.named_at.empty() || std::filesystem::exists(part.path, error)) continue;
    return Error{Fault::kInput,
                 fmt::format("{}: part.path: {}: no such file; correct it (a relative path begins beside the job file)",
                             part.named_at, part.path)};
  }
  return {};
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
    if (Status status = at_option(key.flag, key.read(text, job)); !status) return status.error();
    job.named.push_back(fmt::format("{}.{}", key.section, key.name));
  }
  for (const PartKey& key : part_keys()) {
    if (key.flag.empty() || !choice.has(key.section, key.name) || !arguments.has(key.flag)) continue;
    if (key.flag == "--at" && job.parts.size() > 1) {
      return at_option(key.flag, fmt::format("is for a single part, here are {}; set at_mm of each [[part]] in a job file",
                                             job.parts.size()))
          .error();
    }
    PartRequest unused;
    if (Status status = at_option(key.flag, key.read(arguments.text(key.flag), unused)); !status) return status.error();
    for (PartRequest& part : job.parts) key.read(arguments.text(key.flag), part);
  }
  if (Status status = check_together(choice, arguments, job); !status) return status.error();
  if (arguments.has("--job")) {
    if (Status status = check_parts_of_file(arguments.text("--job"), job); !status) return status.error();
  }
  if (Status status = check_outputs(arguments, job); !status) return status.error();
  return job;
}

}  // namespace lamina::pipeline
