// tests/commands/test_resume.cpp: what --resume and --overwrite make of every state that a run may be ended in.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

class Resume : public ::testing::Test {
 protected:
  Resume() {
    write_box(directory_ / "part.stl", {0, 0, 0}, {6, 4, 3});
    write_box(directory_ / "tall.stl", {0, 0, 0}, {5, 5, 9});
  }

  Outcome run(const std::string& line) {
    std::istringstream stream(line);
    return run_lamina({std::istream_iterator<std::string>(stream), {}}, directory_.path());
  }
  void done(const std::string& line) {
    const Outcome outcome = run(line);
    EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
  }
  /// The call ends in one line and leaves every file as it is.
  void refused(const std::string& line, int code, const std::string& words) {
    const std::string before = tree();
    const Outcome outcome = run(line);
    EXPECT_EQ(outcome.code, code) << line << "\n" << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << line << "\n" << outcome.err;
    EXPECT_NE(outcome.err.find(words), std::string::npos) << line << "\n" << outcome.err;
    EXPECT_TRUE(tree() == before) << line;
  }
  /// Layers that a resumed job planned.
  int planned(const std::string& line) {
    const Outcome outcome = run(line + " --resume --json");
    EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
    const Json summary = Json::parse(outcome.out, nullptr, false);
    return summary.is_object() ? summary.value("layers_planned", -1) : -1;
  }
  std::string tree(const std::string& below = ".") { return tree_text(directory_ / below); }
  void copy(const std::string& from, const std::string& to) {
    fs::remove_all(directory_ / to);
    fs::copy(directory_ / from, directory_ / to, fs::copy_options::recursive);
  }
  void move(const std::string& from, const std::string& to) { fs::rename(directory_ / from, directory_ / to); }
  /// A manifest up to its layer `count`, as a run that was killed then leaves it.
  static std::string begun(const std::string& manifest, int count) {
    std::size_t end = manifest.find("\"layers\": [") + 11;
    for (int i = 0; i < count; ++i) end = manifest.find('\n', end + 1);
    return manifest.substr(0, end);
  }

  Directory directory_;
};

TEST_F(Resume, FilesALayerGoOnFromEveryStateOfTheirEnd) {
  const std::string job = "slice part.stl --layer 0.5 --file-a-layer --quiet -o ";
  done(job + "whole");
  done("slice tall.stl --layer 0.5 --file-a-layer --quiet -o older");
  done("slice tall.stl --layer 0.5 --format cli --quiet -o single");
  const std::string whole = tree("whole"), manifest = read_text(directory_ / "whole/manifest.json");

  // Ended amid the layers; the fourth is torn.
  copy("whole", "a");
  move("a/layers", "a/layers.lamina.part");
  fs::remove(directory_ / "a/manifest.json");
  fs::remove(directory_ / "a/job.toml");
  write_text(directory_ / "a/manifest.json.part", begun(manifest, 4));
  write_text(directory_ / "a/layers.lamina.part/000003.svg", "torn");
  fs::remove(directory_ / "a/layers.lamina.part/000004.svg");
  write_text(directory_ / "a/layers.lamina.part/000004.svg.lamina-abcdefghijklm.part", "torn");
  copy("a", "b");
  EXPECT_EQ(planned(job + "a"), 3);
  EXPECT_EQ(tree("a"), whole);

  // The same next to an older job, whole or half removed.
  for (const bool whole_still : {true, false}) {
    for (const char* older : {"older", "single"}) {
      copy(older, "c");
      copy("b/layers.lamina.part", "c/layers.lamina.part");
      write_text(directory_ / "c/manifest.json.part", begun(manifest, 4));
      if (!whole_still) fs::remove(directory_ / "c/manifest.json");
      if (!whole_still) fs::remove(directory_ / "c/layers/000001.svg");
      const bool stray = !whole_still && std::string_view(older) == "single";  // without a record any more
      EXPECT_EQ(planned(job + "c"), 3);
      if (stray) fs::remove(directory_ / "c/tall.cli");
      EXPECT_EQ(tree("c"), whole) << older << whole_still;
    }
  }

  // All is written; none, all or some of the files have their names.
  for (const int named : {0, 6, 3}) {
    copy("whole", "d");
    move("d/manifest.json", "d/manifest.json.part");
    if (named == 0) move("d/layers", "d/layers.lamina.part");
    if (named == 3) {
      fs::create_directory(directory_ / "d/layers.lamina.part");
      for (const char* name : {"000001.svg", "000002.svg", "000005.svg"})
        move(std::string("d/layers/") + name, std::string("d/layers.lamina.part/") + name);
    }
    EXPECT_EQ(planned(job + "d"), 0) << named;
    EXPECT_EQ(tree("d"), whole) << named;
  }
}

TEST_F(Resume, AFinishedJobIsKeptAndThatOfAnotherIsRefusedBeforeAnythingGoes) {
  for (const char* format : {"svg", "svg --file-a-layer", "cli --file-a-layer", "cli-binary", "3mf", "null"}) {
    const std::string job = std::string(" --layer 1 --quiet -o out --format ") + format;
    done("slice part.stl" + job);
    const std::string before = tree("out");
    EXPECT_EQ(planned("slice part.stl" + job), 0) << format;
    EXPECT_EQ(tree("out"), before) << format;
    refused("slice tall.stl" + job + " --resume", 2, "belongs to another job");
    fs::create_directory(directory_ / "out/layers.lamina.part");
    write_text(directory_ / "out/layers.lamina.part/000000.svg", "begun");
    refused("slice tall.stl" + job + " --resume", 2, "belongs to another job");
    fs::remove_all(directory_ / "out");
  }
}

TEST_F(Resume, AnOlderJobOutlivesOneThatIsRefused) {
  for (const char* format : {"svg", "svg --file-a-layer", "3mf"}) {
    const std::string where = std::string(" --layer 1 --quiet -o cut --overwrite --format ") + format;
    done("slice tall.stl" + where);
    refused("slice part.stl --offset -9" + where, 3, "not one contour");
    refused("slice part.stl --tolerance 900 --strict" + where, 5, "[tolerance]");
    EXPECT_FALSE(fs::exists(directory_ / "cut/layers.lamina.part")) << format;
  }
  for (const char* machine : {"anet-a8 --layer 0.3 -o a.gcode", "fdm-2000 --layer 0.254 -o a.sml"}) {
    const std::string where = std::string(" --quiet --overwrite --machine ") + machine;
    done("extrude tall.stl --walls 1" + where);
    refused("extrude part.stl --walls 0 --fill none" + where, 3, "not one bead");
    refused("extrude part.stl --walls 1 --bottom 5 --strict" + where, 5, "[above-bed]");
  }
}

TEST_F(Resume, ToolpathsThatWereToReplaceOthersGoOn) {
  const std::string job = "extrude part.stl --machine anet-a8 --layer 0.3 --walls 1 --quiet -o ";
  done(job + "whole.gcode");
  done("extrude tall.stl --machine anet-a8 --layer 0.3 --walls 1 --quiet -o older.gcode");
  done(job + "x.gcode");
  const std::string bytes = read_text(directory_ / "x.gcode"), manifest = read_text(directory_ / "x.gcode.json");
  for (const bool older : {true, false}) {
    copy("older.gcode", "x.gcode");
    fs::remove(directory_ / "x.gcode.json");
    if (older) copy("older.gcode.json", "x.gcode.json");
    write_text(directory_ / "x.gcode.part", std::string_view(bytes).substr(0, bytes.size() / 2));
    write_text(directory_ / "x.gcode.json.part", begun(manifest, 9));
    const int made = planned(job + "x.gcode");
    EXPECT_TRUE(0 < made && made < 8) << made;
    EXPECT_EQ(read_text(directory_ / "x.gcode"), bytes);
    EXPECT_EQ(read_text(directory_ / "x.gcode.json"), manifest);
  }
  move("x.gcode.json", "x.gcode.json.part");  // killed between two names
  EXPECT_EQ(planned(job + "x.gcode"), 0);
  EXPECT_EQ(read_text(directory_ / "x.gcode.json"), manifest);
  EXPECT_FALSE(fs::exists(directory_ / "x.gcode.part") || fs::exists(directory_ / "x.gcode.json.part"));
}

TEST_F(Resume, ImagesOfAnOlderJobDoNotMixWithThoseOfTheNewOne) {
  const std::string job = "jet part.stl --layer 1 --dpi 60 --quiet -o ";
  done(job + "whole");
  done("jet tall.stl --layer 0.5 --dpi 60 --format png --quiet -o out");
  fs::remove(directory_ / "out/manifest.json");
  write_text(directory_ / "out/manifest.json.part", "");  // killed while the older job was removed
  EXPECT_EQ(run(job + "out").code, 2);
  refused(job + "out --resume", 2, "a manifest without a header; replace them with --overwrite");
  done(job + "out --overwrite");
  EXPECT_EQ(tree("out"), tree("whole"));
}

TEST_F(Resume, ToolpathsThatNoRecordReportsAreKept) {
  const std::string job = "extrude part.stl --walls 1 --quiet --resume ";
  for (const char* head : {"absent", "torn"}) {
    if (std::string_view(head) == "torn") {
      for (const char* name : {"u.gcode", "u.sml", "v.sml"}) write_text(directory_ / (std::string(name) + ".json.part"), "");
    }
    for (const char* name : {"u.gcode", "u.sml", "v.rp3"}) write_text(directory_ / name, "precious");
    refused(job + "--machine anet-a8 --layer 0.3 -o u.gcode", 2, "u.gcode: is there already");
    refused(job + "--machine fdm-2000 --layer 0.254 -o u.sml", 2, "u.sml: is there already");
    refused(job + "--machine fdm-2000 --layer 0.254 -o v.sml", 2, "v.rp3: is there already");
  }
  fs::remove(directory_ / "u.gcode");
  done(job + "--machine anet-a8 --layer 0.3 -o u.gcode");  // killed before its head
}

TEST_F(Resume, ContoursThatNoRecordReportsAreKept) {
  for (const char* format : {"svg", "3mf"}) {
    const std::string job = std::string("slice part.stl --layer 0.5 --quiet -o out --format ") + format;
    done(job);
    const std::string whole = tree("out"), manifest = read_text(directory_ / "out/manifest.json");
    const std::string file = std::string("out/part.") + format;
    fs::create_directory(directory_ / "out/layers");
    write_text(directory_ / "out/layers/000007.svg", "precious");
    EXPECT_EQ(planned(job), 0) << format;  // next to a finished job
    fs::remove(directory_ / file);
    EXPECT_EQ(planned(job), 6) << format;  // made anew
    EXPECT_EQ(read_text(directory_ / "out/layers/000007.svg"), "precious");

    for (const std::string& head : {std::string(), begun(manifest, 2)}) {
      fs::remove_all(directory_ / "out");
      fs::create_directories(directory_ / "out/layers");
      write_text(directory_ / "out/manifest.json.part", head);
      write_text(directory_ / "out/layers/000007.svg", "precious");
      refused(job + " --resume", 2, "out/layers: contains layers");
      fs::remove_all(directory_ / "out/layers");
      write_text(directory_ / "out/job.toml", "precious");
      refused(job + " --resume", 2, "job.toml: is there already");
      fs::remove(directory_ / "out/job.toml");
      if (head.empty()) {
        write_text(directory_ / file, "precious");
        refused(job + " --resume", 2, "is there already");
        fs::remove(directory_ / file);
      }
      EXPECT_EQ(planned(job), 6) << format;
      EXPECT_EQ(tree("out"), whole) << format;
    }
    fs::remove_all(directory_ / "out");
  }
}

TEST_F(Resume, FilesALayerThatNoRecordReportsAreKept) {
  const std::string job = "slice part.stl --layer 0.5 --file-a-layer --quiet -o out";
  done(job);
  const std::string manifest = read_text(directory_ / "out/manifest.json");
  fs::remove_all(directory_ / "out");
  done("slice tall.stl --layer 0.5 --quiet -o out");
  fs::create_directory(directory_ / "out/layers");
  write_text(directory_ / "out/layers/000003.svg", "precious");
  write_text(directory_ / "out/manifest.json.part", begun(manifest, 2));
  refused(job + " --resume", 2, "out/layers: contains layers");
  fs::remove(directory_ / "out/manifest.json");
  write_text(directory_ / "out/manifest.json.part", "");
  fs::remove(directory_ / "out/job.toml");
  refused(job + " --resume", 2, "out/layers: contains layers");
}

TEST_F(Resume, ImagesThatNoRecordReportsAreKept) {
  fs::create_directories(directory_ / "out/layers");
  write_text(directory_ / "out/layers/000000.tif", "precious");
  for (const bool torn : {false, true}) {
    if (torn) write_text(directory_ / "out/manifest.json.part", "");
    refused("jet part.stl --layer 1 --dpi 60 --quiet -o out --resume", 2, "out/layers: contains layers");
  }
  fs::remove(directory_ / "out/layers/000000.tif");
  EXPECT_EQ(planned("jet part.stl --layer 1 --dpi 60 --quiet -o out"), 3);  // killed before its head
}

// A resumed job is one that verify takes, or is refused with the file that verify would name.
TEST_F(Resume, FilesThatAreNotOfTheJobAreNamedBeforeItGoesOn) {
  const std::string job = "jet part.stl --layer 0.5 --machine xaar128-raw --quiet -o out";
  done(job);
  const std::string whole = read_text(directory_ / "out/manifest.json");
  const std::string program = read_text(directory_ / "out/program/000002.raw.zst");
  ASSERT_FALSE(program.empty());
  for (const char* stray : {"program/000002.raw", "program/000099.raw.zst", "program/start.raw", "program/000002.gcode",
                            "program/notes.txt", "layers/000002.png", "layers/000099.tif", "layers/000002-drop2.tif",
                            "layers/notes.txt"}) {
    const std::string file = std::string("out/") + stray;
    for (const int count : {2, 6}) {  // interrupted, finished
      fs::remove(directory_ / "out/manifest.json");
      write_text(directory_ / (count < 6 ? "out/manifest.json.part" : "out/manifest.json"),
                 count < 6 ? begun(whole, count) : whole);
      write_text(directory_ / file, program);
      refused(job + " --resume", 2, file + ": is not of this job; remove it, or name another directory");
      fs::remove(directory_ / file);
      done(job + " --resume");
      done("verify out --quiet");
    }
  }
  // Programs of another form are of another job.
  refused(job + " --resume --set program.compress=false", 2, "program.compress = false");
  // What a run that was killed before its record left is not mixed with others either.
  fs::remove_all(directory_ / "out");
  fs::create_directories(directory_ / "out/program");
  write_text(directory_ / "out/program/start.raw", "x");
  for (const char* how : {"", " --resume", " --shard 1/2"}) refused(job + how, 2, "out/program/start.raw: is not of this job");
  done(job + " --overwrite");
  done("verify out --quiet");
}

TEST_F(Resume, ShardsAreNotJoinedWithFilesOfOthers) {
  const std::string job = "jet part.stl --layer 0.5 --machine xaar128-raw --quiet -o out --shard ";
  for (const char* shard : {"1/2", "2/2"}) done(job + shard);
  write_text(directory_ / "out/program/000001.raw", "x");
  refused(job + "2/2 --resume", 2, "out/program/000001.raw: is not of this job");
  refused("merge out -o out", 2, "out/program/000001.raw: is not of this job");
  fs::remove(directory_ / "out/program/000001.raw");
  done(job + "2/2 --resume");
  done("merge out -o out --quiet");
  done("verify out --quiet");
}

TEST_F(Resume, AFileInsteadOfTheFolderOfLayersIsReportedBeforeTheyAreMade) {
  fs::create_directory(directory_ / "out");
  write_text(directory_ / "out/layers", "");
  const Outcome outcome = run("slice part.stl --layer 1 --file-a-layer --quiet -o out");
  EXPECT_EQ(outcome.code, 4);
  EXPECT_NE(outcome.err.find("out/layers: is a file, not a directory; remove it"), std::string::npos) << outcome.err;
  EXPECT_FALSE(fs::exists(directory_ / "out/layers.lamina.part"));
  fs::remove(directory_ / "out/layers");
  done("slice part.stl --layer 1 --file-a-layer --quiet -o out");
}

TEST_F(Resume, APipeInsteadOfALayerIsReportedWithWhatHelps) {
  const std::string job = "jet part.stl --layer 1 --dpi 60 --quiet -o out";
  done(job);
  const std::string whole = tree("out");
  for (const bool folder : {false, true}) {
    move("out/manifest.json", "out/manifest.json.part");
    fs::remove(directory_ / "out/layers/000002.tif");
    if (folder) {
      fs::create_directory(directory_ / "out/layers/000002.tif");
    } else {
      ASSERT_EQ(::mkfifo((directory_ / "out/layers/000002.tif").c_str(), 0600), 0);
    }
    const Outcome outcome = run(job + " --resume");
    EXPECT_EQ(outcome.code, 4);
    EXPECT_NE(outcome.err.find("000002.tif: is a"), std::string::npos) << outcome.err;
    EXPECT_NE(outcome.err.find("remove it; finished layers are kept, continue with --resume"), std::string::npos)
        << outcome.err;
    fs::remove(directory_ / "out/layers/000002.tif");
    EXPECT_EQ(planned(job), 1);
    EXPECT_EQ(tree("out"), whole);
  }
}

}  // namespace
}  // namespace lamina::test
