#include "pipeline/nest/nest_files.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/nest/nest_tables.h"
#include "pipeline/nest/plate.h"
#include "pipeline/nest/sheet.h"
#include "pipeline/output/scene_3mf.h"
#include "pipeline/plan/plan.h"
#include "pipeline/report/job_cost.h"
#include "stages/support/io/file.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

fs::path build_folder(const fs::path& directory, std::size_t build) { return directory / fmt::format("build-{}", build + 1); }

constexpr const char* kBuildFiles[] = {"plate.toml", "plate.3mf", "parts.csv", "sheet.html", kKeepOutFile};

/// Removes builds up to a number that is not there; folders stay if others have files in them.
void remove_builds(const fs::path& directory) {
  std::error_code error;
  for (std::size_t b = 0; fs::exists(build_folder(directory, b), error); ++b) {
    for (const char* name : kBuildFiles) fs::remove(build_folder(directory, b) / name, error);
    fs::remove(build_folder(directory, b), error);
  }
}

/// Where builds are until all are written.
fs::path unfinished(const fs::path& directory) { return directory / ".lamina-nest"; }

/// errors  kUsage: the directory has builds already; kOutput
Status make_directory(const fs::path& directory, bool overwrite, bool unpacks) {
  std::error_code error;
  if (fs::exists(directory, error) && !fs::is_directory(directory, error))
    return usage("-o {}: is a file; name a directory", directory.string());
  const bool used = fs::exists(build_folder(directory, 0), error) || (unpacks && fs::exists(directory / "parts", error));
  const std::string orders = (directory / "orders.csv").string();
  constexpr std::string_view kMarks[] = {"^order,customer,file,copies,build,serials,"};
  if (!is_replaceable(orders, kMarks))
    return usage("{}: is there already, and lamina did not write it; name another -o", orders);
  if (!overwrite && (used || fs::exists(orders, error)))
    return usage("-o {}: has builds already; replace them with --overwrite, or name another directory", directory.string());
  fs::create_directories(directory, error);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", directory.string(), error.message())};
  return {};
}

/// The path that a part has once the builds are written.
std::string kept_path(const NestOutput& output, const std::string& path) {
  if (output.unpacked.empty()) return path;
  const fs::path below = fs::path(path).lexically_relative(output.unpacked);
  return below.empty() || *below.begin() == ".." ? path : (fs::path(output.directory) / "parts" / below).string();
}

/// The parts as they stand in the build. errors  of load_scene; kOutput
Status write_plate_3mf(const Job& plate, Product product, const std::string& path) {
  const auto resolved = resolve(plate, product);
  if (!resolved) return resolved.error();
  const auto scene = load_scene(plate, resolved->bed);
  if (!scene) return scene.error();
  auto file = File::open(path, {});
  if (!file) return file.error();
  if (const auto counts = write_scene_3mf(*file, *scene); !counts) return counts.error();
  const auto written = file->finish();
  return written ? Status() : Status(written.error());
}

}  // namespace

Status write_build(const std::string& directory, const NestOutput& output, const OrderTable& table,
                   const SerialNumbers& serials, const Job& options, const std::string& title, const NestPlan& plan,
                   NestBuild& build) {
  const fs::path folder = directory;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", folder.string(), error.message())};
  const std::string job = (folder / "plate.toml").string();
  const Job plate = plate_of(build, table.rows, options);
  Job saved = plate;
  for (PartRequest& part : saved.parts) part.path = kept_path(output, part.path);
  Status status = quote_build(plate, output.product, plan, build);
  if (status) status = save_job(job, saved, command_name(output.product));
  if (status) status = write_plate_3mf(plate, output.product, (folder / "plate.3mf").string());
  if (status) status = write_file((folder / "parts.csv").string(), cost::csv_text(parts_table(build, table, serials)));
  std::string keep_outs;
  for (const std::string& keep_out : output.keep_outs) keep_outs += keep_out + "\n";
  if (status && !keep_outs.empty()) status = write_file((folder / kKeepOutFile).string(), keep_outs);
  if (!status) return status;
  const auto job_file = digest_file(job);
  if (!job_file) return job_file.error();
  std::string presets;
  for (const std::string& preset : options.machine.presets)
    presets += (presets.empty() ? "" : ", ") + fs::path(preset).stem().string();
  return write_file((folder / "sheet.html").string(),
                    sheet_html({title, output.machine, hex(job_file->hash), presets}, plan, build, table.rows, serials));
}

namespace {

/// Moves the builds to their places, and copies unpacked parts. errors  kOutput
Status finish_builds(const NestOutput& output, std::size_t builds) {
  const fs::path directory = output.directory;
  std::error_code error;
  if (!output.unpacked.empty()) {
    fs::create_directories(directory / "parts", error);
    if (!error)
      fs::copy(output.unpacked, directory / "parts", fs::copy_options::recursive | fs::copy_options::overwrite_existing, error);
  }
  if (!error) remove_builds(directory);
  for (std::size_t b = 0; b < builds && !error; ++b)
    error = replace_build(build_folder(unfinished(directory), b).string(), build_folder(directory, b).string());
  if (error) return Error{Fault::kOutput, fmt::format("{}: {}", output.directory, error.message())};
  return {};
}

}  // namespace

std::error_code replace_build(const std::string& from, const std::string& to) {
  std::error_code error;
  fs::create_directories(to, error);
  for (const char* name : kBuildFiles) {
    if (error || (name == std::string_view(kKeepOutFile) && !fs::exists(fs::path(from) / name))) continue;
    fs::rename(fs::path(from) / name, fs::path(to) / name, error);
  }
  return error;
}

std::vector<std::string> files_of_nest(const std::string& directory) {
  std::vector<std::string> files{(fs::path(directory) / "orders.csv").string()};
  std::error_code error;
  for (std::size_t b = 0; fs::exists(build_folder(directory, b), error); ++b)
    for (const char* name : kBuildFiles) files.push_back((build_folder(directory, b) / name).string());
  return files;
}

Status write_nest(const NestOutput& output, const OrderTable& table, const Job& options, const ProgressCallback& progress,
                  const std::atomic<bool>& cancel, NestPlan& plan) {
  const fs::path directory = output.directory;
  if (Status status = make_directory(directory, output.overwrite, !output.unpacked.empty()); !status) return status;
  // Begun first and finished last: it is the claim of the directory.
  auto orders = File::open((directory / "orders.csv").string(), {.replace = output.overwrite});
  if (!orders) return orders.error();
  std::error_code error;
  const fs::path begun = unfinished(directory);
  fs::remove_all(begun, error);  // of a killed run
  const std::string name = fs::weakly_canonical(directory, error).filename().string();
  const auto count = static_cast<std::uint32_t>(plan.builds.size());
  const SerialNumbers serials = serial_numbers(table);
  Status status;
  for (std::uint32_t b = 0; b < count && status; ++b) {
    progress({ProgressEvent::Stage::kBuilds, b, count});
    const std::string title = fmt::format("{}, build {} of {}", name, b + 1, count);
    status = write_build(build_folder(begun, b).string(), output, table, serials, options, title, plan, plan.builds[b]);
    if (cancel) status = Error{Fault::kInterrupted, fmt::format("-o {}: interrupted; nothing was written", output.directory)};
  }
  if (status) status = orders->append(cost::csv_text(orders_table(plan, table, serials)));
  if (status) status = orders->flush();
  if (status) status = finish_builds(output, count);
  fs::remove_all(begun, error);
  if (!status) return status;
  const auto written = orders->finish();
  return written ? Status() : Status(written.error());
}

}  // namespace lamina::pipeline
