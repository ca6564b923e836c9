// SPDX-License-Identifier: Apache-2.0
#include "daemon/metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cctype>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>
#include <string>

namespace stickslip::daemon {
namespace {

using Labels = std::map<std::string, std::string>;

/// A page as a Prometheus server reads it. Violations of the text format or the naming rules are
/// problems.
struct Scrape {
  std::map<std::string, std::string> types;
  std::map<std::pair<std::string, Labels>, double> samples;
  std::vector<std::string> problems;

  double at(const std::string& name, Labels labels = {}) const {
    labels["rig"] = "r";
    const auto found = samples.find({"stickslip_" + name, labels});
    EXPECT_NE(found, samples.end()) << name;
    return found == samples.end() ? -1.0 : found->second;
  }
};

/// The name at `at`: letters, digits, underscores and, with `colons`, colons; no digit first. Empty
/// if there is none.
std::string name_at(const std::string& line, std::size_t at, bool colons) {
  std::size_t end = at;
  while (end < line.size()) {
    const auto c = static_cast<unsigned char>(line[end]);
    const bool letter = std::isalpha(c) != 0 || c == '_' || (colons && c == ':');
    if (!letter && (end == at || std::isdigit(c) == 0)) break;
    ++end;
  }
  return line.substr(at, end - at);
}

/// Parses `{name="value",...}` from `at`; false if malformed.
bool read_labels(const std::string& line, std::size_t& at, Labels& labels) {
  if (line.at(at) != '{') return true;
  ++at;
  while (at < line.size() && line[at] != '}') {
    const std::string label = name_at(line, at, false);
    at += label.size();
    if (label.empty() || line.compare(at, 2, "=\"") != 0) return false;
    at += 2;
    std::string value;
    for (; at < line.size() && line[at] != '"'; ++at) {
      if (line[at] == '\\') {
        ++at;
        if (at >= line.size() || std::string("\\\"n").find(line[at]) == std::string::npos) {
          return false;
        }
        value += line[at] == 'n' ? '\n' : line[at];
      } else {
        value += line[at];
      }
    }
    if (at >= line.size() || !labels.emplace(label, value).second) return false;
    ++at;
    if (at < line.size() && line[at] == ',') ++at;
  }
  return at < line.size() && line[at++] == '}';
}

Scrape scrape(const std::string& page) {
  Scrape out;
  std::set<std::string> helped;
  std::string family;
  if (page.empty() || page.back() != '\n') out.problems.push_back("no line feed at the end");
  std::istringstream lines(page);
  for (std::string line; std::getline(lines, line);) {
    const auto problem = [&](const std::string& what) {
      out.problems.push_back(what + ": " + line);
    };
    std::istringstream words(line);
    std::string hash;
    std::string keyword;
    std::string name;
    if (line.starts_with("# HELP ")) {
      words >> hash >> keyword >> name;
      if (!helped.insert(name).second) problem("duplicate help");
      if (line.size() <= 8 + name.size()) problem("no help");
      family = name;
      continue;
    }
    if (line.starts_with("# TYPE ")) {
      std::string type;
      words >> hash >> keyword >> name >> type;
      if (name != family) problem("a type without its help");
      if (!out.types.emplace(name, type).second) problem("duplicate type");
      if (!std::set<std::string>{"counter", "gauge", "summary"}.contains(type)) problem("type");
      if (name.ends_with("_total") != (type == "counter")) problem("counters end in _total");
      for (const char* unit : {"_ns", "_us", "_ms", "_milliseconds", "_count", "_sum"}) {
        if (name.ends_with(unit)) problem("not a base unit, or a reserved ending");
      }
      continue;
    }
    name = name_at(line, 0, true);
    if (name.empty()) {
      problem("no name");
      continue;
    }
    std::size_t at = name.size();
    Labels labels;
    if (!read_labels(line, at, labels)) problem("labels");
    if (at >= line.size() || line[at] != ' ') problem("no blank before the value");
    const std::string digits = line.substr(at + 1);
    char* end = nullptr;
    const double value = std::strtod(digits.c_str(), &end);
    if (digits.empty() || *end != '\0') problem("no number");
    const std::string& type = out.types[family];
    const bool own = name == family ||
                     (type == "summary" && (name == family + "_sum" || name == family + "_count"));
    if (!own) problem("outside its family");
    if (labels.contains("quantile") && type != "summary") problem("a quantile in no summary");
    if (!out.samples.emplace(std::pair(name, labels), value).second) problem("duplicate");
  }
  return out;
}

Status some_status() {
  Status status;
  status.state = RigState::running;
  status.uptime_ns = 2'500'000'000;
  status.ledger.produced = 2500;
  status.ledger.published.enabled = true;
  status.ledger.published.delivered = 2400;
  status.ledger.published.lost[static_cast<std::size_t>(Loss::ring_full)] = 30;
  status.cycles = 2501;
  status.overruns = 3;
  status.skipped_periods = 4;
  status.longest_overrun_ns = 1'500'000;
  status.degraded = true;
  status.lateness_count = 2500;
  status.lateness_total_ns = 25'000'000;
  status.lateness_p50_ns = 9'000;
  status.lateness_p99_ns = 40'000;
  status.lateness_max_ns = 800'000;
  status.work_count = 2501;
  status.missing_at_source = 7;
  status.failed_reads = 1;
  status.failed_writes = 2;
  status.not_finite = 5;
  status.lost_messages = 6;
  return status;
}

TEST(Metrics, FollowTheFormatAndHoldTheStatus) {
  const Scrape page = scrape(metrics_text(some_status(), "r", 1'700'000'000'250'000));
  EXPECT_THAT(page.problems, testing::IsEmpty());
  EXPECT_EQ(page.at("updated_timestamp_seconds"), 1'700'000'000.25);
  EXPECT_EQ(page.at("uptime_seconds"), 2.5);
  EXPECT_EQ(page.at("frames_produced_total"), 2500);
  EXPECT_EQ(page.at("frames_delivered_total", {{"consumer", "publisher"}}), 2400);
  EXPECT_EQ(page.at("frames_lost_total", {{"consumer", "publisher"}, {"reason", "ring_full"}}), 30);
  EXPECT_EQ(page.at("frames_lost_total", {{"consumer", "publisher"}, {"reason", "shutdown"}}), 0);
  EXPECT_EQ(page.at("frames_pending", {{"consumer", "publisher"}}), 70);
  EXPECT_EQ(page.at("cycles_total"), 2501);
  EXPECT_EQ(page.at("overruns_total"), 3);
  EXPECT_EQ(page.at("skipped_periods_total"), 4);
  EXPECT_DOUBLE_EQ(page.at("overrun_max_seconds"), 0.0015);
  EXPECT_EQ(page.at("timing_degraded"), 1);
  EXPECT_DOUBLE_EQ(page.at("wakeup_lateness_seconds", {{"quantile", "0.5"}}), 9e-6);
  EXPECT_DOUBLE_EQ(page.at("wakeup_lateness_seconds", {{"quantile", "0.99"}}), 4e-5);
  EXPECT_DOUBLE_EQ(page.at("wakeup_lateness_seconds_sum"), 0.025);
  EXPECT_EQ(page.at("wakeup_lateness_seconds_count"), 2500);
  EXPECT_DOUBLE_EQ(page.at("wakeup_lateness_max_seconds"), 8e-4);
  EXPECT_EQ(page.at("cycle_work_seconds_count"), 2501);
  EXPECT_EQ(page.at("frames_missing_at_source_total"), 7);
  EXPECT_EQ(page.at("failed_reads_total"), 1);
  EXPECT_EQ(page.at("failed_writes_total"), 2);
  EXPECT_EQ(page.at("readings_not_finite_total"), 5);
  EXPECT_EQ(page.at("lost_messages_total"), 6);
}

TEST(Metrics, HoldTheCountsOfEachDevice) {
  Status status = some_status();
  status.devices.add({"LabJack U6", "overflows", 4});
  status.devices.add({"LabJack U6", "backlog", 200, drivers::Count::Kind::level});
  status.devices.add({"a \"bridge\"", "readings_missing", 9});
  const Scrape page = scrape(metrics_text(status, "r", 0));
  EXPECT_THAT(page.problems, testing::IsEmpty());
  const auto labels = [](const char* device, const char* event) {
    return Labels{{"device", device}, {"event", event}};
  };
  EXPECT_EQ(page.at("device_events_total", labels("LabJack U6", "overflows")), 4);
  EXPECT_EQ(page.at("device_events_total", labels("a \"bridge\"", "readings_missing")), 9);
  EXPECT_EQ(page.at("device_level", {{"device", "LabJack U6"}, {"level", "backlog"}}), 200);
}

TEST(Metrics, ADisabledConsumerIsAbsentAndNotZero) {
  const Scrape page = scrape(metrics_text(some_status(), "r", 0));
  for (const auto& [name_and_labels, value] : page.samples) {
    const auto consumer = name_and_labels.second.find("consumer");
    if (consumer == name_and_labels.second.end()) continue;
    EXPECT_EQ(consumer->second, "publisher") << name_and_labels.first;
  }
}

TEST(Metrics, TheRigIsInOneStateAtATimeAndAFaultIsAFlag) {
  for (const RigState state : {RigState::idle, RigState::running, RigState::stopping,
                               RigState::armed, RigState::faulted}) {
    Status status = some_status();
    status.state = state;
    const Scrape page = scrape(metrics_text(status, "r", 0));
    EXPECT_EQ(page.at("state", {{"state", name_of(state)}}), 1);
    double sum = 0;
    for (const auto& [name_and_labels, value] : page.samples) {
      if (name_and_labels.first == "stickslip_state") sum += value;
    }
    EXPECT_EQ(sum, 1);
    EXPECT_EQ(page.at("fault"), state == RigState::faulted ? 1 : 0);
  }
}

TEST(Metrics, LargeCountersKeepEveryDigit) {
  Status status = some_status();
  status.ledger.produced = 9'007'199'254'740'993;  // not representable as double
  EXPECT_THAT(metrics_text(status, "r", 0),
              testing::HasSubstr("stickslip_frames_produced_total{rig=\"r\"} 9007199254740993\n"));
}

RC_GTEST_PROP(Metrics, AnyNameOfARigIsReadBack, (const std::string& name)) {
  // Labels may hold any characters; only three are escaped.
  const Scrape page = scrape(metrics_text(some_status(), name, 0));
  RC_ASSERT(page.problems.empty());
  for (const auto& [name_and_labels, value] : page.samples) {
    RC_ASSERT(name_and_labels.second.at("rig") == name);
  }
}

TEST(Metrics, TheLintDetectsViolations) {
  const auto problems = [](const std::string& page) { return scrape(page).problems.size(); };
  EXPECT_EQ(problems("# HELP a_total h\n# TYPE a_total counter\na_total{x=\"\\\"\"} 1\n"), 0U);
  EXPECT_GT(problems("# HELP a h\n# TYPE a counter\na 1\n"), 0U);
  EXPECT_GT(problems("# HELP a h\n# TYPE a gauge\na 1"), 0U);
  EXPECT_GT(problems("# HELP a h\n# TYPE a gauge\na{x=\"\\q\"} 1\n"), 0U);
  EXPECT_GT(problems("# HELP a h\n# TYPE a gauge\na 1\na 2\n"), 0U);
  EXPECT_GT(problems("# HELP a h\n# TYPE a gauge\nb 1\n"), 0U);
  EXPECT_GT(problems("# HELP a h\n# TYPE a gauge\na{quantile=\"0.5\"} 1\n"), 0U);
  EXPECT_GT(problems("# HELP a_ns h\n# TYPE a_ns gauge\na_ns 1\n"), 0U);
}

class MetricsFile : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "stickslip-XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string content(const std::filesystem::path& file) const {
    std::ifstream in(file);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  std::filesystem::path folder_;
};

TEST_F(MetricsFile, IsReplacedAtomicallyAndReadableByEveryone) {
  const auto file = folder_ / "stickslip.prom";
  const mode_t before = umask(0077);
  EXPECT_EQ(write_metrics(file, "a 1\n"), "");
  std::ifstream reader(file);  // opened before the second write: keeps the first content
  EXPECT_EQ(write_metrics(file, "b 2\n"), "");
  umask(before);
  EXPECT_EQ(content(file), "b 2\n");
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(reader), {}), "a 1\n");
  struct stat status {};
  ASSERT_EQ(stat(file.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0644U);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), {}), 1);
}

TEST_F(MetricsFile, ErrorsAreReportedAndNothingIsLeftBehind) {
  EXPECT_THAT(write_metrics(folder_ / "none" / "stickslip.prom", "a 1\n"),
              testing::HasSubstr("cannot be written: No such file or directory"));
  std::filesystem::create_directories(folder_ / "stickslip.prom" / "taken");
  EXPECT_THAT(write_metrics(folder_ / "stickslip.prom", "a 1\n"),
              testing::HasSubstr("cannot be replaced"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), {}), 1);
  std::filesystem::create_symlink(folder_ / "elsewhere", folder_ / "other.prom.new");
  EXPECT_THAT(write_metrics(folder_ / "other.prom", "a 1\n"),
              testing::HasSubstr("cannot be written"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "elsewhere"));
}

}  // namespace
}  // namespace stickslip::daemon
