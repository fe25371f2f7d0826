#include "pipeline/job/keys.h"

#include <fmt/format.h>

#include "pipeline/job/file.h"

namespace lamina::pipeline {

std::span<const JobKey> job_keys() {
  // The order of the sections in a job file. A new group is a file job/<group>.cpp and a line here.
  static const std::vector<JobKey> keys = [] {
    std::vector<JobKey> all;
    for (const std::span<const JobKey> group :
         {bed_keys(), heights_keys(), place_keys(), image_keys(), machine_keys(), dose_keys(), slice_keys(), fill_keys(),
          extrude_keys(), segment_keys(), load_keys(), run_keys()}) {
      all.insert(all.end(), group.begin(), group.end());
    }
    return all;
  }();
  return keys;
}

std::vector<KeyFacts> key_facts() {
  std::vector<KeyFacts> facts;
  const auto add = [&]<class Target>(std::span<const Key<Target>> keys, const Target& presets) {
    for (const auto& key : keys) {
      facts.push_back({fmt::format("{}.{}", key.section, key.name), std::string(key.flag), std::string(key.value),
                       key.write(presets), std::string(key.meaning), (key.decides & decides::images) != 0});
    }
  };
  add(job_keys(), Job());
  add(part_keys(), PartRequest());
  return facts;
}

}  // namespace lamina::pipeline
