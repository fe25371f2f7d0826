// pipeline/nest/add_to_build.h: more parts into a build that is written already, whose parts stay where they are.
#pragma once

#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/nest/nest.h"
#include "pipeline/nest/nest_files.h"
#include "pipeline/nest/order_table.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// A build as it was written.
struct WrittenBuild {
  Job job;           // of plate.toml; its parts are the different settings that parts have, the first one's first
  OrderTable table;  // its parts, each a row with its position; serial numbers of its other builds
  std::string material;
  std::vector<std::string> keep_outs;  // as --keep-out has them
};

/// The folder of a build without links and "." in its name: its last part is build-N.
std::string whole_path(const std::string& folder);

/// Reads FOLDER/plate.toml, parts.csv and keep_out.txt, and the serial numbers of ../orders.csv if it is there.
/// errors  kUsage, kInput: a file is missing, or they do not have the same parts at the same positions
Result<WrittenBuild> read_build(const std::string& folder);

/// Writes the build anew, and into ../orders.csv, if it is there, the new rows and the prices of all; or nothing.
/// output  its directory is the folder of the build
/// rows    that were in the build before, at the front of the table
/// errors  kOutput; of quote_build
Status write_added(const NestOutput& output, const OrderTable& table, std::size_t rows, const Job& options, NestPlan& plan);

}  // namespace lamina::pipeline
