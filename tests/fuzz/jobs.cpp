// Job files, and assignments of single keys.
#include "pipeline/job/file.h"
#include "pipeline/job/job.h"
#include "tests/fuzz/laws.h"

namespace lamina::fuzz {
namespace {

using pipeline::Job;

/// What is read can be written, and reads back as the same.
void check_round_trip(const Job& job) {
  const std::string written = pipeline::job_text(job, "");
  Job again;
  const Status read = pipeline::read_job_text(written, "/jobs/again.toml", again);
  law(read.ok(), read.ok() ? "" : read.error().message.c_str());
  law(pipeline::job_text(again, "") == written, "a job that was written reads back as another one");
  for (const Product product : {Product::kImages, Product::kContours, Product::kMoves}) {
    law(pipeline::canonical_job_text(job, product) == pipeline::canonical_job_text(again, product), "canonical texts differ");
  }
}

bool read_job(std::string_view text) {
  Job job;
  const Status read = pipeline::read_job_text(text, "/jobs/job.toml", job);
  if (!read) return check_error(read.error()), false;
  check_round_trip(job);
  if (const Status checked = pipeline::check_job(job); !checked) check_error(checked.error());
  return true;
}

bool set_keys(std::string_view lines) {
  Job job;
  job.parts.resize(2);
  job.parts[0].path = "/parts/one.stl";
  job.parts[1].path = "/parts/two.stl";
  bool all = true, any = false;
  for (std::size_t at = 0, count = 0; at < lines.size() && count < 50; ++count) {
    const std::size_t end = std::min(lines.find('\n', at), lines.size());
    const Status set = pipeline::set_key(job, lines.substr(at, end - at));
    if (!set) check_error(set.error());
    all &= set.ok();
    any |= set.ok();
    at = end + 1;
  }
  if (!any || Dice(lines).below(8) != 0) return all;  // a hundred times as long as setting a key
  const auto position = [](std::string& path) {       // a job file means paths from its folder
    if (!path.empty()) path = "/parts/" + path;
  };
  for (pipeline::PartRequest& part : job.parts) position(part.path);
  for (std::string& preset : job.machine.presets) position(preset);
  position(job.machine.profile), position(job.output);
  check_round_trip(job);
  return all;
}

std::vector<std::string> job_seeds() {
  Job job;
  job.parts.resize(2);
  job.parts[0].path = "/parts/one.stl";
  job.parts[1].path = "/parts/two \"x\" \\.3mf";
  std::string every = "# every key that has a preset\n";
  std::string section;
  for (const pipeline::KeyFacts& key : pipeline::key_facts()) {
    const std::size_t dot = key.name.find('.');
    if (dot == std::string::npos || key.preset.empty() || key.name.starts_with("part.")) continue;
    if (section != key.name.substr(0, dot)) every += "[" + (section = key.name.substr(0, dot)) + "]\n";
    every += "# " + key.name.substr(dot + 1) + " = " + key.preset + "\n";
  }
  return {pipeline::job_text(job, ""),
          "[bed]\nsize_mm = [60, 40]\ndpi = [600, 300]\n[heights]\nmode = \"cusp\"\nthickness_mm = [0.1, 0.2]\n"
          "[[part]]\npath = \"a.stl\"\nscale = [1, -1, 2]\nrotate_deg = [0, 90, 0]\nat_mm = [1, 2]\ncopies = 3\n"
          "[[part]]\npath = \"b.obj\"\nunit = \"inch\"\nfill = { gap_mm = [0.1], angle_deg = 30 }\n",
          "[fill]\npattern = \"raster\"\ngap_mm = [0, 0.2]\nrange = [{ from_mm = 1, to_mm = 2.5, angle_deg = 90 }]\n", every};
}

std::vector<std::string> key_seeds() {
  return {
      "bed.dpi=600\nbed.size_mm=60x40\npart.copies=2\npart.2.scale=[1, -1, 2]\npart.1.fill={ gap_mm = 0.1 }\n"
      "heights.thickness_mm=0.05..0.3:0.01\nrun.memory=1.5G\nrun.layers=2:10"};
}

constexpr std::string_view kJobSources = "pipeline/job stages/support/text pipeline/job/profiles";
const Registered kJob({"job", read_job, job_seeds, kJobSources, ".toml", "toml.dict", 4096});
const Registered kKeys({"keys", set_keys, key_seeds, kJobSources, "", "toml.dict", 1024});

}  // namespace
}  // namespace lamina::fuzz
