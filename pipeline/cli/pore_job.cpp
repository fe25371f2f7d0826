#include "pipeline/cli/pore_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/cli/console.h"
#include "pipeline/cli/keys.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/job/job.h"
#include "pipeline/job/lists/job_command.h"
#include "pipeline/machine/profiles.h"
#include "pipeline/output/temporary_folder.h"
#include "pipeline/plan/plan.h"
#include "pipeline/run/run.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// Reports the job next to the results of its files, which have no name outside of the call.
class JobContext : public Context {
 public:
  /// made  the file or folder that the job became; shown  its name for people
  JobContext(Context& outer, std::string made, std::string shown, std::string line, Json job)
      : outer_(outer), made_(std::move(made)), shown_(std::move(shown)), line_(std::move(line)), job_(std::move(job)) {}
  void say_text(std::string_view text) override { outer_.say_text(shown(std::string(text))); }
  /// Messages name files by their paths.
  std::string shown(const std::string& text) override {
    std::string renamed = text;
    for (std::size_t at = renamed.find(made_); at != std::string::npos; at = renamed.find(made_, at + shown_.size()))
      renamed.replace(at, made_.size(), shown_);
    return renamed;
  }
  int complain(const Error& error) override { return outer_.complain(error); }
  Status print(std::string_view text) override { return outer_.print(std::exchange(line_, {}) + std::string(text)); }
  Status give(const Json& value) override {
    Json reported = value;
    reported["job"] = job_;
    return outer_.give(reported);
  }
  void progress(const ProgressEvent& event) override { outer_.progress(event); }
  const std::atomic<bool>& cancel() override { return outer_.cancel(); }

 private:
  Context& outer_;
  std::string made_, shown_, line_;
  Json job_;
};

/// The job as lamina jet and lamina extrude read it.
Result<Job> read_job_of(const Arguments& arguments) {
  Arguments of_job;
  of_job.operands.assign(arguments.operands.begin() + 1, arguments.operands.end());
  of_job.options.emplace_back("--job", arguments.operands.front());
  for (const auto& [flag, text] : arguments.options)
    if (flag == "--set" || flag == "--machine" || is_output_option(flag)) of_job.options.emplace_back(flag, text);
  Result<Job> job = read_job_options({"machine.profile"}, of_job);
  if (!job) return job;
  job->leave_to_machine = true;
  job->quiet = true;
  job->overwrite = job->resume = job->dry_run = false;
  job->shard.reset();
  job->format = Job().format;
  return job;
}

/// The command that a saved job names in its first line; "" for others.
std::string saved_command(const std::string& path) {
  const auto text = read_file(path, {.fault = Fault::kUsage, .missing = "no such job file", .max_bytes = kMaxTomlBytes});
  return text ? std::string(pipeline::command_in(std::string_view(*text).substr(0, text->find('\n')))) : "";
}

/// errors  kUsage: no such machine, or nothing names it
Result<Product> product_of(const std::string& path, const Job& job, bool by_option) {
  if (!job.machine.profile.empty()) {
    const Result<bool> moves = names_extruder(job.machine.profile);
    if (!moves)
      return Error{moves.error().fault, fmt::format("{}: {}", by_option ? "--machine" : one_line(path) + ": machine.profile",
                                                    moves.error().message)};
    return *moves ? Product::kMoves : Product::kImages;
  }
  if (const std::string command = saved_command(path); command == "extrude" || command == "jet")
    return command == "jet" ? Product::kImages : Product::kMoves;
  const auto names = [&](std::initializer_list<std::string_view> sections) {
    return std::ranges::any_of(job.named, [&](std::string_view key) {
      return std::ranges::any_of(sections, [&](std::string_view section) { return key.starts_with(section); });
    });
  };
  const bool moves = names({"extrude."}), images = names({"bed.dpi", "dose.", "image.format", "image.mirror"});
  if (images != moves) return images ? Product::kImages : Product::kMoves;
  return Error{Fault::kUsage, fmt::format("{}: names no machine, and may be of filament or of powder; add --machine, as in "
                                          "--machine anet-a8 or --machine nuferbj",
                                          one_line(path))};
}

/// The box of the first part in machine coordinates, of a job that has others too.
std::optional<Box> first_part(const Summary& summary, const std::array<double, 2>& corner_mm) {
  const bool alone = summary.parts.size() == 1 && summary.parts.front().copies == 1;
  if (alone || summary.parts.empty() || summary.parts.front().bounds.empty()) return std::nullopt;
  Box box = summary.parts.front().bounds;
  const auto x = static_cast<Nm>(std::llround(corner_mm[0] * 1e6)), y = static_cast<Nm>(std::llround(corner_mm[1] * 1e6));
  box.lo.x += x, box.hi.x += x, box.lo.y += y, box.hi.y += y;
  return box;
}

/// The arguments of a call on the files.
Arguments arguments_on(const std::string& files, const Job& job, Product product, const Arguments& arguments) {
  Arguments inner = arguments;
  inner.operands = {files};
  std::erase_if(inner.options, [](const auto& option) { return option.first == "--set" || option.first == "--machine"; });
  // Toolpaths name no printer that a file describes.
  if (product == Product::kMoves && !job.machine.profile.empty() && arguments.text("--beads") != "stated")
    inner.options.emplace_back("--machine", job.machine.profile);
  return inner;
}

}  // namespace

bool names_job(const std::string& path) { return lower_case(path).ends_with(".toml"); }

Outcome predict_job(const Arguments& arguments, Context& context, Predict predict) {
  const std::string& path = arguments.operands.front();
  Result<Job> job = read_job_of(arguments);
  if (!job) return job.error();
  const Result<Product> product = product_of(path, *job, arguments.has("--machine"));
  if (!product) return product.error();
  const bool moves = *product == Product::kMoves;
  if (moves && job->segment.all.on && job->fill.all.pattern == infill::Pattern::kNone)
    job->fill.all.pattern = infill::Pattern::kRaster;
  const TemporaryFolder folder("permeability");
  if (const Status status = folder.status(); !status) return status;
  job->output = folder.file(moves ? "part.gcode" : "job");
  if (Status status = check_job(*job); !status) return status;
  Result<Resolved> resolved = resolve(*job, *product);
  if (!resolved) return resolved.error();
  std::array<double, 2> corner_mm{};
  if (resolved->extruder) {
    const Extruder& machine = resolved->extruder->machine;
    if (machine.format != "gcode")
      return Error{Fault::kUsage, fmt::format("{}: {} writes {}, and beads are read from G-code; add another --machine",
                                              one_line(path), machine.name, machine.format)};
    corner_mm = machine.bed.corner_mm;
  }
  keep_on_signals();
  const auto summary = run(
      std::move(*resolved), [](const ProgressEvent&) {}, context.cancel());
  if (!summary) {
    if (summary.error().fault == Fault::kInterrupted) return Error{Fault::kInterrupted, "interrupted; nothing was written"};
    return summary.error();
  }
  for (const Warning& warning : summary->warnings) context.say_text(fmt::format("warning   {}\n", one_line(warning.text)));
  Json parts = Json::array();
  for (const PartSummary& part : summary->parts) parts.push_back(part.path);
  const std::string machine = summary->machine.empty() ? "" : ", " + one_line(summary->machine);
  JobContext reported(context, job->output, one_line(path),
                      fmt::format("job       {}: planned as lamina {} does, {} layers {}{}\n", one_line(path),
                                  command_name(*product), summary->layers_planned, summary->layer_text, machine),
                      {{"path", path},
                       {"command", command_name(*product)},
                       {"machine", summary->machine},
                       {"layers", summary->layers_planned},
                       {"parts", parts},
                       {"warnings", warnings_json(summary->warnings)}});
  Outcome outcome = predict(arguments_on(job->output, *job, *product, arguments), reported,
                            moves ? first_part(*summary, corner_mm) : std::nullopt);
  if (outcome.error) outcome.error->message = reported.shown(outcome.error->message);
  return outcome;
}

}  // namespace lamina::pipeline
