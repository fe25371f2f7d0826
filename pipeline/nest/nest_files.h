// pipeline/nest/nest_files.h: the files of a nesting: a job and a parts list for each build, and the orders with their builds.
#pragma once

#include <atomic>
#include <string>
#include <system_error>
#include <vector>

#include "pipeline/nest/nest.h"
#include "pipeline/plan/progress.h"
#include "pipeline/report/summary.h"
#include "stages/data/choices.h"
#include "stages/data/status.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// Serial numbers of each row's copies: ORDER-001, or FILE-001 without an order; counted over all rows of one order, without
/// those that are in use.
std::vector<std::vector<std::string>> serial_numbers(const OrderTable& table);

/// Sets the copies of rows that fill builds to those that builds have.
void count_fillers(const NestPlan& plan, OrderTable& table);

/// Hundredths of a currency of each copy: "3.20", or "3.20 3.21 3.20" where they differ; and their sum. "" without any
std::string each_price(const std::vector<std::int64_t>& cents);
std::string sum_price(const std::vector<std::int64_t>& cents);

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

/// Writes DIR/build-1/{plate.toml, plate.3mf, parts.csv, sheet.html}, ... and DIR/orders.csv, or nothing; sets what builds
/// take.
///
/// options   settings of the jobs, plate.toml
/// progress  a build counts as a layer
/// cancel    set when the caller has to stop
/// errors    kUsage: the directory has builds and `overwrite` is not set; kOutput; kInterrupted; of quote_build
Status write_nest(const NestOutput& output, const OrderTable& table, const Job& options, const ProgressCallback& progress,
                  const std::atomic<bool>& cancel, NestPlan& plan);

/// A build's job, its parts and its sheet in its folder, in place of earlier ones; sets what it takes.
/// errors  kOutput; of quote_build
Status write_build(const std::string& folder, const NestOutput& output, const OrderTable& table, const Job& options,
                   const std::string& title, const NestPlan& plan, NestBuild& build);

/// Moves the files of a build to another folder, in place of those of an earlier one.
std::error_code replace_build(const std::string& from, const std::string& to);

/// Sets what builds take, and writes nothing. errors  kInterrupted; of quote_build
Status quote_builds(Product product, const OrderTable& table, const Job& options, const ProgressCallback& progress,
                    const std::atomic<bool>& cancel, NestPlan& plan);

/// The row's copies with their builds and, once these are quoted, prices: orders.csv.
std::vector<std::vector<std::string>> orders_table(const NestPlan& plan, const OrderTable& table);

/// The files that a nesting into a directory would replace, if they are there.
std::vector<std::string> files_of_nest(const std::string& directory);

/// A line for each row of which copies have no build.
Summary::Lines left_lines(const NestPlan& plan, const OrderTable& table);
Summary::Lines nest_lines(const NestPlan& plan, const OrderTable& table);
/// What the copies of each row cost, if builds are quoted.
Summary::Lines price_lines(const NestPlan& plan, const OrderTable& table);
/// What a copy of each row costs in a build of which a share of bed x height is parts, whichever the other parts are: hours and
/// powder of its share of the height, by the hours and the powder a millimetre of the quoted builds.
/// percent  > 0
Summary::Lines density_lines(const NestPlan& plan, const OrderTable& table, double percent);
/// density  as of density_lines; 0 for none
Json nest_json(const NestPlan& plan, const OrderTable& table, double density = 0);

}  // namespace lamina::pipeline
