// pipeline/nest/nest_files.h: the files of a nesting: a job and a parts list for each build, and the orders with their builds.
#pragma once

#include <atomic>
#include <string>
#include <system_error>
#include <vector>

#include "pipeline/nest/nest.h"
#include "pipeline/nest/nest_tables.h"
#include "pipeline/plan/progress.h"
#include "stages/data/choices.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// In the folder of a build: what --keep-out said, a line each; only if it said anything.
inline constexpr const char* kKeepOutFile = "keep_out.txt";

/// What the files of a nesting are made for.
struct NestOutput {
  std::string directory;
  bool overwrite = false;
  Product product = Product::kImages;       // of the jobs
  std::string machine = {};                 // its name, for the sheets; may be empty
  std::vector<std::string> keep_outs = {};  // as --keep-out has them
  std::string unpacked = {};                // folder of part files that are copied to DIR/parts; may be empty
};

/// Writes DIR/build-1/{plate.toml, plate.3mf, parts.csv, sheet.html}, ... and DIR/orders.csv, or nothing: builds are in
/// DIR/.lamina-nest until all are written. Sets what builds take.
///
/// options   settings of the jobs, plate.toml
/// progress  before each build
/// cancel    set when the caller has to stop
/// errors    kUsage: the directory has builds and `overwrite` is not set; kOutput; kInterrupted; of quote_build
Status write_nest(const NestOutput& output, const OrderTable& table, const Job& options, const ProgressCallback& progress,
                  const std::atomic<bool>& cancel, NestPlan& plan);

/// A build's job, its parts and its sheet in a folder; sets what it takes.
/// title   "week, build 1 of 2"
/// errors  kOutput; of quote_build
Status write_build(const std::string& folder, const NestOutput& output, const OrderTable& table, const SerialNumbers& serials,
                   const Job& options, const std::string& title, const NestPlan& plan, NestBuild& build);

/// Moves the files of a build to another folder, in place of those of an earlier one.
std::error_code replace_build(const std::string& from, const std::string& to);

/// The files that a nesting into a directory would replace, if they are there.
std::vector<std::string> files_of_nest(const std::string& directory);

}  // namespace lamina::pipeline
