// pipeline/job/keys.h: every key of a job file, once: its name, its flag, how it is read and how it is written.
//
// Options (command_keys.h), job files, --set, --save-job, the manifest and the help are made from these two tables.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/text/key_form.h"

namespace lamina::pipeline {

/// One key of a job (Target is Job) or of each [[part]] of it (Target is PartRequest).
template <class Target>
struct Key {
  std::string_view section;  // table in the job file; "part" for keys of [[part]]
  std::string_view name;
  std::string_view flag;     // option with the same meaning; empty if there is none
  std::string_view value;    // what stands behind the option: "MM", "WIDTHxDEPTH"; empty for a switch
  std::string_view meaning;  // for the help, one line
  bool decides_bytes;        // goes into the manifest: two jobs that differ here are different jobs

  /// Reads the value from text; lists are separated by commas. returns "" or what is wrong; the target is then as it was
  std::string (*read)(std::string_view text, Target& target);
  /// The value as read() takes it; "" if it is not set.
  std::string (*write)(const Target& target);
  KeyForm form;
  /// What a flag without a value means, as in --no-repair: "false".
  std::string_view switch_text = {};
};

using JobKey = Key<Job>;
using PartKey = Key<PartRequest>;

/// All keys of a job, the groups below one after the other; keys of a section stand together.
std::span<const JobKey> job_keys();
std::span<const PartKey> part_keys();

// --- the groups, one file each: job_keys_<group>.cpp
std::span<const JobKey> bed_keys();
std::span<const JobKey> heights_keys();
std::span<const JobKey> place_keys();
std::span<const JobKey> image_keys();
std::span<const JobKey> slice_keys();
std::span<const JobKey> fill_keys();
std::span<const JobKey> extrude_keys();  // [extrude] and [segment]
std::span<const JobKey> load_keys();
std::span<const JobKey> machine_keys();
std::span<const JobKey> dose_keys();
std::span<const JobKey> run_keys();

}  // namespace lamina::pipeline
