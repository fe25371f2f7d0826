#include "pipeline/cli/made_profiles.h"

#include <fmt/format.h>

#include <optional>
#include <string>

#include "pipeline/machine/import/import_profile.h"
#include "pipeline/machine/new_profile.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"

namespace lamina::pipeline {
namespace {

Status write_profile(const std::string& text, const Arguments& arguments, Context& context) {
  const std::string output = arguments.text("-o,--output");
  return output.empty() ? context.print(text) : write_file(output, text, {.stream = true});
}

Outcome import_file(const Arguments& arguments, Context& context) {
  const std::string file = arguments.text("--import");
  const auto imported =
      import_profile(file, {{arguments.text("--printer"), arguments.text("--filament")}, arguments.has("--plain-code")});
  if (!imported) return imported.error();
  if (Status status = write_profile(imported->text, arguments, context); !status) return status;
  for (const std::string& note : imported->notes) context.say("note: " + note);
  context.say(fmt::format("{}: {} settings were not used", file, imported->unused.size()));
  if (!imported->unused.empty()) context.say(fmt::format("not used: {}", fmt::join(imported->unused, ", ")));
  return 0;
}

Outcome read_answers(const Arguments& arguments, Context& context) {
  for (const char* flag : {"--printer", "--filament", "--plain-code"}) {
    if (arguments.has(flag)) return at_option(flag, "applies to --import; leave it out");
  }
  auto input = FileReader::open("-", {.fault = Fault::kUsage, .longest_line = 4096, .streams = true});
  if (!input) return input.error();
  const auto profile = new_profile([&](const std::string& text) -> std::optional<std::string> {
    context.say_text(text);
    std::string_view line;
    return input->next(line) ? std::optional(std::string(line)) : std::nullopt;
  });
  if (!input->status()) return input->status();
  if (!profile) return profile.error();
  return write_profile(*profile, arguments, context);
}

}  // namespace

Outcome make_profile(const Arguments& arguments, Context& context) {
  const char* const flag = arguments.has("--import") ? "--import" : "--new";
  for (const char* other : {"--check", "--show", "--preset", "--dialects", "--target"}) {
    if (arguments.has(other)) return at_option(flag, fmt::format("is done alone; leave out {}", other));
  }
  if (!arguments.operands.empty()) return at_option(flag, "is done alone; leave out the names of machines");
  if (arguments.has("--import") && arguments.has("--new")) return at_option(flag, "is done alone; leave out --new");
  return arguments.has("--import") ? import_file(arguments, context) : read_answers(arguments, context);
}

}  // namespace lamina::pipeline
