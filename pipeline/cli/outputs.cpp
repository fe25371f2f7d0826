#include "pipeline/cli/outputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <vector>

#include "pipeline/job/errors.h"
#include "pipeline/manifest/layer_files.h"
#include "pipeline/report/job_cost.h"
#include "stages/formats/voxels/image.h"
#include "stages/support/io/file.h"
#include "stages/support/io/paged.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

struct InputOption {
  std::string_view flag, role;
};
constexpr InputOption kInputs[] = {{"--job", "the job file"},
                                   {"--machine", "the machine profile"},
                                   {"--preset", "a preset"},
                                   {"--material", "a material"},
                                   {"--check", "a machine profile"},
                                   {"--show", "a machine profile"},
                                   {"--measured", "the measurements"},
                                   {"--measure", "a measured table"},
                                   {"--parts", "a part"},
                                   {"--add", "a part"},
                                   {"--into", "the build"},
                                   {"--keep-out", "a keep-out"},
                                   {"--model", "the model"},
                                   {"--scan", "a scan"},
                                   {"--chart", "the chart"},
                                   {"--import", "the profile"}};
constexpr std::string_view kOutputs[] = {"-o,--output", "--save-job", "--plot",  "--target",
                                         "--solid",     "--void",     "--quote", "--overlay"};

/// An output file of a command. Marks: every such file of lamina contains one of them in its head; a leading ^ means at
/// the very start.
struct OwnFile {
  std::string_view command, flag;
  bool stream;  // may go to a device, a pipe or standard output
  std::array<std::string_view, 5> marks;
};
constexpr std::string_view kPicture("Software\0lamina", 15), kDrawing = "<!-- drawn by lamina -->";
constexpr OwnFile kOwnFiles[] = {
    {"", "--save-job", false, {"^# A job of lamina."}},
    {"", "--quote", false, {"^part,copies,volume_mm3,pixels,drops,"}},
    {"heights", "-o,--output", true, {"^layers    ", "^way    ", "^table,layer,", "^{\"schema\":1,\"height_mm\":", "^Portugu"}},
    {"heights", "--plot", false, {kDrawing, kPicture}},
    {"permeability", "--plot", false, {kDrawing, kPicture}},
    {"permeability", "--solid", false, {formats::voxels::kMark}},
    {"permeability", "--void", false, {formats::voxels::kMark}},
    {"", "--overlay", false, {kPicture}},
    {"preview", "-o,--output", false, {kDrawing, kPicture}},
    {"report", "-o,--output", false, {"name=\"generator\" content=\"lamina\""}},
    {"calibrate", "-o,--output", false, {"Made by lamina calibrate."}},
    {"design", "-o,--output", false, {"Made by lamina design."}},
    {"machines", "--target", false, {"^orientation target"}},
    {"machines", "-o,--output", true, {"^# Imported by lamina", "^# Made by lamina machines"}},
    {"stream", "-o,--output", true, {}},
};
/// Commands whose -o is a directory that they make, or may be.
constexpr std::string_view kMakesFolders[] = {"jet", "slice", "convert", "merge", "manual", "calibrate", "batch", "watch"};

/// The folder of a file, or of what a link leads to.
std::optional<FileId> folder_id(const std::string& file) {
  std::error_code ignored;
  const fs::path position = fs::is_symlink(file, ignored) ? fs::weakly_canonical(file, ignored) : fs::absolute(file, ignored);
  return file_id(position.parent_path().string());
}

/// The directory read, of a job or a chart, in which a file or what a link leads to lies; "" for none.
std::string directory_read(const std::string& file, const Arguments& arguments) {
  std::vector<std::string> read = arguments.operands;
  for (const std::string& chart : arguments.all("--chart")) {
    const std::string folder = is_file(chart) ? fs::absolute(chart).parent_path().string() : chart;
    read.insert(read.end(), {folder, folder + "/images", folder + "/print"});
  }
  const auto position = folder_id(file);
  const auto found = std::ranges::find_if(read, [&](const std::string& directory) {
    return std::ranges::any_of(std::array{"", "/layers", "/program"},
                               [&](const char* below) { return position && position == file_id(directory + below); });
  });
  return found == read.end() ? "" : *found;
}

/// What no input may be, or lie in: an output that is there, and the folders in which a run would remove or replace files.
struct Taken {
  const std::string* output;
  FileId id;
  bool folder;
};

std::vector<Taken> taken_by(std::span<const std::string> outputs) {
  std::vector<Taken> taken;
  for (const std::string& output : outputs) {
    const auto own = file_id(output);
    if (!own) continue;
    taken.push_back({&output, *own, false});
    for (const char* below : {"/layers", "/program"}) {
      if (const auto id = file_id(output + below)) taken.push_back({&output, *id, true});
    }
    for (const std::string& file : paged_job_files(output)) {
      if (const auto id = file_id(file)) taken.push_back({&output, *id, false});
    }
  }
  return taken;
}

std::vector<InputFile> inputs_of(const Arguments& arguments, std::string_view operand_role) {
  std::vector<InputFile> inputs;
  for (const std::string& operand : arguments.operands) inputs.push_back({operand, std::string(operand_role)});
  for (const InputOption& option : kInputs) {
    for (const std::string& path : arguments.all(option.flag)) {
      inputs.push_back({path, std::string(option.role)});
      if (option.flag == "--chart") inputs.push_back({path + "/chart.json", "the chart"});
    }
  }
  return inputs;
}

/// An output and the files written next to it; toolpaths may have a table of layers.
void add_output(const std::string& path, std::vector<std::string>& outputs) {
  if (path.empty()) return;
  for (const char* ending : {"", ".part", ".json", ".json.part"}) outputs.push_back(path + ending);
  if (fs::path(path).has_filename()) outputs.push_back(fs::path(path).replace_extension(".rp3").string());
}

std::vector<std::string> outputs_of(const Arguments& arguments) {
  std::vector<std::string> outputs;
  for (const std::string_view flag : kOutputs) add_output(arguments.text(flag), outputs);
  return outputs;
}

/// Two outputs of one call are two files. errors  kUsage
Status check_apart(const Arguments& arguments) {
  std::vector<fs::path> positions;
  if (std::ranges::count_if(kOutputs, [&](std::string_view flag) { return arguments.has(flag); }) < 2) return {};
  for (const std::string_view flag : kOutputs) {
    const std::string path = arguments.text(flag);
    if (path.empty() || is_stream(path)) continue;
    std::error_code ignored;
    const auto position = [&](const std::string& file) { return fs::weakly_canonical(fs::absolute(file, ignored), ignored); };
    const std::array own = {position(path), position(path + ".json")};
    if (std::ranges::find_first_of(positions, own) != positions.end())
      return usage("{}: is named for two outputs of this call; name another file", path);
    positions.insert(positions.end(), own.begin(), own.end());
  }
  return {};
}

}  // namespace

bool is_input_option(std::string_view flag) {
  return std::ranges::find(kInputs, flag, &InputOption::flag) != std::end(kInputs);
}
bool is_output_option(std::string_view flag) { return std::ranges::find(kOutputs, flag) != std::end(kOutputs); }

Status check_outputs(std::span<const InputFile> inputs, std::span<const std::string> outputs) {
  const std::vector<Taken> taken = taken_by(outputs);  // computed once, for there may be thousands of inputs
  if (taken.empty()) return {};
  for (const InputFile& input : inputs) {
    if (!is_file(input.path)) continue;
    const auto file = file_id(input.path), folder = folder_id(input.path);
    const auto found = std::ranges::find_if(taken, [&](const Taken& one) { return (one.folder ? folder : file) == one.id; });
    if (found == taken.end()) continue;
    if (!found->folder) return usage("{}: is read by this call as {}; name another output", *found->output, input.role);
    return usage("{}: is read by this call as {}, and lies among the layers of the output {}; name another output", input.path,
                 input.role, *found->output);
  }
  return {};
}

Status check_folder(std::string_view flag, const std::string& file) {
  const std::string name = fs::path(file).filename().string();  // commands refuse those of directories
  const bool is_named = !name.empty() && name != "." && name != "..";
  const Status status = is_named && !is_stream(file) ? check_can_write(file, false) : Status();
  if (status) return {};
  return failure(status.error().fault, "{} {}", flag, status.error().message);
}

Status check_own_file(const std::string& path, std::span<const std::string_view> marks) {
  if (is_replaceable(path, marks)) return {};
  return usage("{}: is there already, and is no such file of lamina; name another one, or replace it with --overwrite", path);
}

Status check_quote(const Arguments& arguments, const std::string& directory) {
  const std::string path = arguments.text("--quote");
  if (path.empty() || directory.empty() || !lies_in_job(path, directory)) return {};
  return usage("--quote {}: is among the files of the job in {}; name another file", one_line(path), one_line(directory));
}

Status write_quote(const Arguments& arguments, const std::vector<std::vector<std::string>>& rows) {
  if (!arguments.has("--quote")) return {};
  if (rows.empty()) return failure(Fault::kInput, "--quote: the job has no machine, or layers whose time was not recorded");
  return write_file(arguments.text("--quote"), cost::csv_text(rows));
}

Status check_outputs(std::string_view command, const Arguments& arguments) {
  const std::string_view operands = command == "batch"          ? "a list"
                                    : command == "permeability" ? "what is measured"
                                    : command == "preview"      ? "what is drawn"
                                    : command == "stream"       ? "the job"
                                                                : "a part";
  std::vector<std::string> outputs = outputs_of(arguments);
  if (command == "batch") {
    for (const char* name : {"batch.jsonl", "summary.json", "summary.tsv"})
      outputs.push_back(arguments.text("-o,--output") + "/" + name);
  }
  if (Status status = check_apart(arguments); !status) return status;
  if (Status status = check_outputs(inputs_of(arguments, operands), outputs); !status) return status;
  for (const std::string_view flag : kOutputs) {
    const std::string path = arguments.text(flag);
    std::error_code ignored;
    const bool is_main = flag == kOutputs[0];
    if (path.empty() || is_stream(path) || (is_main && arguments.has("--dry-run"))) continue;
    // A merge into a whole job writes nothing.
    if (is_main && command == "merge" && fs::is_directory(path, ignored)) continue;
    const bool is_folder = is_main && std::ranges::find(kMakesFolders, command) != std::end(kMakesFolders);
    if (const Status status = is_folder ? check_can_write(path, true) : check_folder(flag.substr(0, flag.find(',')), path);
        !status)
      return status;
  }
  for (const OwnFile& own : kOwnFiles) {
    if ((!own.command.empty() && own.command != command) || !arguments.has(own.flag)) continue;
    const std::string path = arguments.text(own.flag);
    if (!own.stream && is_stream(path)) {
      return failure(Fault::kOutput, "{}: is {}, not a file; name another one", path,
                     path == "-" ? "standard output" : "a device or a pipe");
    }
    const Status status = check_own_file(path, own.marks);
    if (status) continue;
    if (const std::string directory = directory_read(path, arguments); !directory.empty())
      return usage("{}: belongs to {}, which this call reads; name another output", path, directory);
    if (!arguments.has("--overwrite")) return status;
  }
  return {};
}

Status check_outputs(const Arguments& arguments, const Job& job) {
  std::vector<InputFile> inputs = inputs_of(arguments, "a part");
  for (const PartRequest& part : job.parts) inputs.push_back({part.path, "a part"});
  inputs.push_back({job.machine.profile, "the machine profile"});
  inputs.push_back({job.extrude.material, "a material"});
  for (const std::string& preset : job.machine.presets) inputs.push_back({preset, "a preset"});
  if (Status status = check_quote(arguments, job.output); !status) return status;
  std::vector<std::string> outputs = outputs_of(arguments);
  if (std::ranges::find(outputs, job.output) == outputs.end()) add_output(job.output, outputs);
  return check_outputs(inputs, outputs);
}

}  // namespace lamina::pipeline
