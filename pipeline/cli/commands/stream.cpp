#include <fmt/format.h>

#include "pipeline/check/stream.h"
#include "pipeline/cli/command.h"
#include "pipeline/job/errors.h"
#include "pipeline/manifest/layer_files.h"
#include "stages/support/io/file.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

CommandSpec stream_spec() {
  CommandSpec spec;
  spec.summary =
      "Writes the whole print program of a job for its host: start, layers in order and end, expanded if they are\n"
      "compressed. Each file is compared with its hash in the manifest before it is written. With --consume, a call\n"
      "continues with the first layer that the host has not received.";
  spec.operand = "DIR";
  spec.operand_meaning = "the directory of a whole job that lamina jet wrote with --machine";
  spec.options = {{"-o,--output", "FILE", "file, device or pipe; default: stdout", "", ""},
                  {"--overwrite", "", "replace an existing file", "", ""},
                  {"--consume", "", "delete each layer once the host has received it", "", ""},
                  {"--json", "", "print the result as one JSON object on stdout (with -o)", "", ""},
                  {"--quiet", "", "print errors only", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina stream out > program.planes\n"
      "  lamina stream out -o part.planes\n"
      "  lamina stream out --consume | cat > received.planes";
  return spec;
}

Outcome run_stream(const Arguments& arguments, Context& context) {
  if (arguments.operands.size() != 1) return usage("name one directory of a job to stream");
  const std::string& directory = arguments.operands.front();
  const std::string output = arguments.has("-o,--output") ? arguments.text("-o,--output") : "-";
  if (output == "-" && arguments.has("--json")) return at_option("--json", "needs -o FILE; the program takes stdout");
  if (!is_stream(output) && lies_in_job(output, directory))
    return usage("-o {}: is among the files of the job; name another file", one_line(output));
  const auto report = stream_program(directory, output, arguments.has("--consume"));
  if (!report) return report.error();
  if (!arguments.has("--quiet")) {
    context.say(fmt::format("{}: {} layers, {} written{}", one_line(report->directory), readable_count(report->layers),
                            readable_bytes(report->bytes), report->bytes == 0 ? "; everything was delivered before" : ""));
  }
  if (!arguments.has("--json")) return {};
  return context.give({{"command", "stream"},
                       {"directory", report->directory},
                       {"output", output},
                       {"layers", report->layers},
                       {"bytes_written", report->bytes}});
}

}  // namespace

const Command stream_command = {"stream", "write the whole print program of a job for its host", stream_spec, run_stream};

}  // namespace lamina::pipeline
