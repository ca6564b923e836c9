// SPDX-License-Identifier: Apache-2.0
// Contents of exported recordings.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <matio.h>
#include <stdlib.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"
#include "protocol/recording.h"
#include "protocol/recording_log.h"
#include "tools/recording_export/table.h"
#include "tools/recording_export/write_tables.h"

namespace stickslip::recording_export {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr std::size_t frame_count = 25;
// Large enough that a double cannot represent nanoseconds.
constexpr std::int64_t origin_ns = 1'720'000'000'000'000'001;

class Export : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "stickslip-export-XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    write_log(folder_ / "run.log");
  }
  void TearDown() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  static std::int64_t time_ns(std::size_t i) {
    return origin_ns + static_cast<std::int64_t>(i) * 1'000'000;
  }

  static void write_log(const fs::path& file) {
    protocol::LogWriter writer(file);
    const auto append = [&](const char* channel, const auto& message) {
      std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
      message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
      ASSERT_TRUE(writer.append(channel, bytes, 0));
    };
    protocol::Description description{1'720'000'000'000'000,   "Prüfstand",   "stickslipd", "0.1.0",
                                      "[rig]\nname = \"x\"\n", "schema = 1\n"};
    append(protocol::recording_channel, protocol::info_of(description, -1));
    std::vector<Frame> frames(frame_count);
    for (std::size_t i = 0; i < frame_count; ++i) {
      frames[i].time_ns = time_ns(i);
      frames[i].sequence = 100 + i;
      if (i != 3) frames[i].set(Channel::displacement, 1.0 / (1.0 + static_cast<double>(i)));
      frames[i].set(Channel::normal_load, 0.15);
      frames[i].age_us[index_of(Channel::normal_load)] = 250;
    }
    frame_block_t block;
    protocol::to_block(frames, block);
    append(protocol::frames_channel, block);
    excitation_t excitation{};
    excitation.time_ns = time_ns(9);
    excitation.sequence = 109;
    excitation.drive = 0.004;
    excitation.amplifier_on = 1;
    excitation.earlier = 3;
    excitation.earlier_by = {20, 4, 1};  // the first refers to a frame that is not in the log
    excitation.earlier_drive = {1.0, 0.001, 0.003};
    excitation.earlier_amplitude = {1.0F, 0.5F, 0.5F};
    excitation.earlier_phase_rad = {1.0F, 0.25F, 0.5F};
    excitation.earlier_state = {0x80, 0, 0x83};
    append(protocol::excitation_channel, excitation);
    friction_estimate_t estimate{};
    estimate.time_ns = time_ns(9);
    estimate.sequence = 109;
    append(protocol::estimate_channel, estimate);  // not valid
    estimate.time_ns = time_ns(19);
    estimate.sequence = 119;
    estimate.valid = 1;
    estimate.mu = 0.8;
    estimate.state_count = 4;
    estimate.state_name = {"mu", "theta", "velocity_m_s", "gamma_per_s"};
    estimate.state = {0.8, 0.5, 0.1, 150.0};
    estimate.covariance = {
        {0.04, 0.0, 0.0, 0.0}, {0.0, 0.01, 0.0, 0.0}, {0.0, 0.0, 0.01, 0.0}, {0.0, 0.0, 0.0, 4.0}};
    append(protocol::estimate_channel, estimate);
    ASSERT_TRUE(writer.close());
  }

  fs::path export_to(const std::string& name) const {
    write_tables(tables_of(folder_ / "run.log"), folder_ / name);
    return folder_ / name;
  }

  fs::path folder_;
};

TEST_F(Export, CsvHasOneRowPerFrame) {
  std::ifstream in(export_to("run.csv"));
  std::vector<std::string> comments;
  std::vector<std::string> rows;
  for (std::string line; std::getline(in, line);) {
    (line.starts_with('#') ? comments : rows).push_back(line);
  }
  EXPECT_THAT(comments, testing::Contains("# rig: Prüfstand"));
  EXPECT_THAT(comments, testing::Contains("#   name = \"x\""));
  EXPECT_THAT(comments, testing::Contains("# model: schema = 1"));  // on a line of its own
  EXPECT_THAT(comments,
              testing::Contains(HasSubstr("displacement_m: deflection of the mass relative to the "
                                          "moving frame [m]")));
  for (const char* unit :
       {"# estimate_state_theta: state of the observer [1]",
        "# estimate_state_velocity_m_s: state of the observer [m/s]",
        "# estimate_state_gamma_per_s_std: standard deviation of the state [1/s]"}) {
    EXPECT_THAT(comments, testing::Contains(unit));
  }
  EXPECT_THAT(comments, testing::Not(testing::Contains(HasSubstr("[SI]"))));
  ASSERT_EQ(rows.size(), frame_count + 1);
  EXPECT_EQ(rows[0],
            "time_s,time_ns,sequence,valid,gap,displacement_m,normal_load_n,normal_load_age_s,"
            "excitation_drive,excitation_amplitude,excitation_carrier_hz,excitation_phase_rad,"
            "excitation_amplifier_on,estimate_valid,estimate_theta,estimate_mu,"
            "estimate_gamma_per_s,estimate_friction_force_n,estimate_slip_velocity_m_s,"
            "estimate_sticking,estimate_raw_friction_force_n,estimate_raw_coefficient,"
            "estimate_nis,estimate_nis_freedom,estimate_nis_mean,"
            "estimate_nis_mean_low,estimate_nis_mean_high,estimate_state_gamma_per_s,"
            "estimate_state_gamma_per_s_std,estimate_state_mu,estimate_state_mu_std,"
            "estimate_state_theta,estimate_state_theta_std,estimate_state_velocity_m_s,"
            "estimate_state_velocity_m_s_std");
  EXPECT_THAT(rows[1], HasSubstr(",1720000000000000001,100,9,0,1,0.15,0.00025,,,,,,,"));
  EXPECT_THAT(rows[4], HasSubstr(",103,8,0,,0.15,"));  // displacement was not measured
  EXPECT_THAT(rows[6],
              HasSubstr(",105,9,0,0.16666666666666666,0.15,0.00025,0.001,0.5,0,0.25,0,,,"));
  EXPECT_THAT(rows[9], HasSubstr(",108,9,0,0.1111111111111111,0.15,0.00025,0.003,0.5,0,0.5,1,,,"));
  EXPECT_THAT(rows[10], HasSubstr(",109,9,0,0.1,0.15,0.00025,0.004,0,0,0,1,0,,,"));
  EXPECT_THAT(rows[20], HasSubstr(",119,9,0,0.05,0.15,0.00025,,,,,,1,0,0.8,0,"));
  EXPECT_THAT(rows[20], testing::EndsWith(",150,2,0.8,0.2,0.5,0.1,0.1,0.1"));
}

TEST_F(Export, EveryColumnIsInTheFormats) {
  std::ifstream in(STICKSLIP_SOURCE_DIR "/docs/formats.md");
  const std::string page{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  for (const Table& table : tables_of(folder_ / "run.log").tables) {
    const std::string prefix = table.name == "frames" ? "" : table.name + "_";
    for (const Column& column : table.columns) {
      std::string name = column.name;
      if (name.ends_with("_std")) name.resize(name.size() - 4);
      const bool state = name.starts_with("state_");
      const bool age = name.ends_with("_age_s");
      const bool shared = name == "time_s" || name == "time_ns" || name == "sequence";
      const std::string documented = state    ? name.substr(6)
                                     : age    ? "displacement_age_s"
                                     : shared ? name
                                              : prefix + name;
      EXPECT_THAT(page, HasSubstr("`" + documented + "`")) << column.name;
    }
  }
}

struct CloseMat {
  void operator()(mat_t* file) const { Mat_Close(file); }
};
struct FreeMat {
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};

TEST_F(Export, MatlabFileHasStructsOfColumns) {
  const std::unique_ptr<mat_t, CloseMat> file(
      Mat_Open(export_to("run.mat").c_str(), MAT_ACC_RDONLY));
  ASSERT_TRUE(file);
  EXPECT_EQ(Mat_GetVersion(file.get()), MAT_FT_MAT5);
  const auto variable = [&](const char* name) {
    return std::unique_ptr<matvar_t, FreeMat>(Mat_VarRead(file.get(), name));
  };
  const auto frames = variable("frames");
  ASSERT_TRUE(frames);
  const auto column = [](const auto& of, const char* name) {
    const matvar_t* field = Mat_VarGetStructFieldByName(of.get(), name, 0);
    EXPECT_NE(field, nullptr) << name;
    return field;
  };
  const matvar_t* time = column(frames, "time_ns");
  ASSERT_EQ(time->class_type, MAT_C_INT64);
  ASSERT_EQ(time->dims[0], frame_count);
  EXPECT_EQ(static_cast<const std::int64_t*>(time->data)[7], time_ns(7));
  const matvar_t* x = column(frames, "displacement_m");
  ASSERT_EQ(x->class_type, MAT_C_DOUBLE);
  EXPECT_EQ(static_cast<const double*>(x->data)[24], 1.0 / 25.0);
  EXPECT_TRUE(std::isnan(static_cast<const double*>(x->data)[3]));
  EXPECT_EQ(static_cast<const std::uint8_t*>(column(frames, "valid")->data)[3], 8);
  EXPECT_EQ(static_cast<const double*>(column(frames, "normal_load_age_s")->data)[0], 0.00025);
  const auto text = [](const matvar_t* v) {
    return std::string(static_cast<const char*>(v->data), v->nbytes);
  };
  EXPECT_EQ(text(column(variable("frames_units"), "displacement_m")), "m");
  const auto estimate = variable("estimate");
  ASSERT_TRUE(estimate);
  const matvar_t* mu = column(estimate, "mu");
  ASSERT_EQ(mu->dims[0], 2U);
  EXPECT_TRUE(std::isnan(static_cast<const double*>(mu->data)[0]));
  EXPECT_EQ(static_cast<const double*>(mu->data)[1], 0.8);
  EXPECT_EQ(static_cast<const double*>(column(variable("excitation"), "drive")->data)[2], 0.004);
  const auto description = variable("description");
  ASSERT_TRUE(description);
  EXPECT_EQ(text(column(description, "configuration")), "[rig]\nname = \"x\"\n");
  EXPECT_EQ(text(column(description, "started_utc")), "2024-07-03T09:46:40Z");
}

class Hdf5File {
 public:
  explicit Hdf5File(const fs::path& file)
      : id_(H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT)) {}
  ~Hdf5File() { H5Fclose(id_); }
  Hdf5File(const Hdf5File&) = delete;
  Hdf5File& operator=(const Hdf5File&) = delete;
  bool good() const { return id_ >= 0; }

  template <class Number>
  std::vector<Number> values(const char* path, hid_t type) const {
    const hid_t data = H5Dopen2(id_, path, H5P_DEFAULT);
    EXPECT_GE(data, 0) << path;
    const hid_t space = H5Dget_space(data);
    std::vector<Number> out(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
    EXPECT_GE(H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, out.data()), 0);
    H5Sclose(space);
    H5Dclose(data);
    return out;
  }
  std::string attribute(const char* path, const char* name) const {
    const hid_t attribute = H5Aopen_by_name(id_, path, name, H5P_DEFAULT, H5P_DEFAULT);
    EXPECT_GE(attribute, 0) << path << ' ' << name;
    const hid_t type = H5Aget_type(attribute);
    std::string out(H5Tget_size(type), '\0');
    H5Aread(attribute, type, out.data());
    H5Tclose(type);
    H5Aclose(attribute);
    return out.c_str();
  }

 private:
  hid_t id_;
};

TEST_F(Export, Hdf5HasUnitsAndTheDescriptionAsAttributes) {
  const Hdf5File file(export_to("run.h5"));
  ASSERT_TRUE(file.good());
  const auto times = file.values<std::int64_t>("/frames/time_ns", H5T_NATIVE_INT64);
  ASSERT_EQ(times.size(), frame_count);
  EXPECT_EQ(times[24], time_ns(24));
  const auto x = file.values<double>("/frames/displacement_m", H5T_NATIVE_DOUBLE);
  EXPECT_EQ(x[24], 1.0 / 25.0);
  EXPECT_TRUE(std::isnan(x[3]));
  EXPECT_EQ(file.values<std::uint8_t>("/frames/valid", H5T_NATIVE_UINT8)[3], 8);
  EXPECT_EQ(file.attribute("/frames/displacement_m", "unit"), "m");
  EXPECT_EQ(file.values<double>("/estimate/state_mu_std", H5T_NATIVE_DOUBLE)[1], 0.2);
  EXPECT_EQ(file.values<double>("/excitation/amplifier_on", H5T_NATIVE_DOUBLE)[2], 1.0);
  EXPECT_EQ(file.attribute("/", "rig"), "Prüfstand");
  EXPECT_EQ(file.attribute("/", "configuration"), "[rig]\nname = \"x\"\n");
  EXPECT_EQ(file.attribute("/", "calibration"), "");
}

TEST_F(Export, ALongConfigurationIsAnHdf5Dataset) {
  Tables tables = tables_of(folder_ / "run.log");
  tables.description.configuration = std::string(200'000, 'x');
  write_tables(tables, folder_ / "long.h5");
  const Hdf5File file(folder_ / "long.h5");
  ASSERT_TRUE(file.good());
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  const hid_t id = H5Fopen((folder_ / "long.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  const hid_t data = H5Dopen2(id, "/configuration", H5P_DEFAULT);
  EXPECT_GE(data, 0);
  H5Dclose(data);
  H5Fclose(id);
}

TEST_F(Export, CsvRecordingsAreExported) {
  std::ofstream(folder_ / "in.csv") << "time_s,velocity_m_s\n0,1\n0.001,2\n";
  write_tables(tables_of(folder_ / "in.csv"), folder_ / "out.h5");
  const Hdf5File file(folder_ / "out.h5");
  EXPECT_EQ(file.values<double>("/frames/velocity_m_s", H5T_NATIVE_DOUBLE)[1], 2.0);
}

// The sequence numbers of the second gap are continuous.
TEST_F(Export, LostFramesAndStepsOfTheTimeAreMarked) {
  protocol::Recording recording;
  for (std::size_t i = 0; i < 100; ++i) {
    if (i == 40) continue;
    Frame frame;
    frame.sequence = i;
    frame.time_ns = time_ns(i) + (i < 70 ? 0 : 5'000'000'000);
    frame.set(Channel::displacement, 0.5);
    recording.frames.push_back(frame);
  }
  recording.channels = 1;
  protocol::write_log(recording, folder_ / "steps.log");
  const Tables tables = tables_of(folder_ / "steps.log");
  const auto& gap = std::get<std::vector<std::uint8_t>>(tables.find("frames")->find("gap")->values);
  const auto& sequence =
      std::get<std::vector<std::int64_t>>(tables.find("frames")->find("sequence")->values);
  for (std::size_t i = 0; i < gap.size(); ++i) {
    EXPECT_EQ(gap[i], sequence[i] == 41 || sequence[i] == 70 ? 1 : 0) << sequence[i];
  }
  EXPECT_THAT(tables.time_steps, HasSubstr("the time steps by 5.000 s after "));
  write_tables(tables, folder_ / "steps.csv");
  std::ifstream in(folder_ / "steps.csv");
  const std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  EXPECT_THAT(text, HasSubstr("# time_steps: the time steps by 5.000 s after "));
  EXPECT_THAT(text, HasSubstr(",70,1,1,0.5\n"));
  EXPECT_THAT(text, HasSubstr(",71,1,0,0.5\n"));
}

TEST_F(Export, ReportsUnwritableFiles) {
  const Tables tables = tables_of(folder_ / "run.log");
  for (const char* name : {"/nowhere/at/all/run.csv", "/nowhere/at/all/run.mat",
                           "/nowhere/at/all/run.h5", "run.xlsx"}) {
    EXPECT_THROW(write_tables(tables, name), InputError) << name;
  }
}

}  // namespace
}  // namespace stickslip::recording_export
