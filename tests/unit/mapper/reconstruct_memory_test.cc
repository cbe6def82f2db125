#include <map>
#include <vector>

#include "mapper/stages.h"
#include "support/test.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {
namespace {

// 10 images and as many long tracks as need some hundred megabytes.
struct MemoryFixture {
  MemoryFixture() {
    constexpr point2D_t kNumTracks = 60000;
    for (image_t id = 1; id <= 10; ++id) {
      RegisteredImage image;
      image.points2D.assign(kNumTracks, Eigen::Vector2d::Zero());
      model.images[id] = image;
    }
    for (point2D_t k = 0; k < kNumTracks; ++k) {
      tracks.emplace_back();
      for (image_t id = 1 + k % 5; id <= 5 + k % 5; ++id) tracks.back().push_back({id, k});
    }
  }
  bool Fit(double max_memory_gib) {
    settings.reconstruct.max_memory_gib = max_memory_gib;
    fitted = tracks;
    return FitTracksToMemory(context, model, fitted);
  }
  SceneData scene;
  ReconstructSettings settings;
  RunReport report;
  StageContext context{scene, settings, kOneThread, report};
  Reconstruction model;
  std::vector<Track> tracks, fitted;
};

TEST(FitTracksToMemory, TakesAllThatFit) {
  MemoryFixture fixture;
  ASSERT_TRUE(fixture.Fit(0));
  EXPECT_EQ(fixture.fitted, fixture.tracks);
  const StageReport& stage = fixture.report.stages.back();
  EXPECT_EQ(stage.name, "memory");
  EXPECT_GT(Value(stage, "limit_gib"), 0.2);
  EXPECT_GT(Value(stage, "estimated_peak_gib"), Value(stage, "resident_gib") + 0.05);
  EXPECT_THAT(stage.messages[0], HasSubstr("10 images and 60000 tracks: predicted peak memory "));
}

TEST(FitTracksToMemory, TakesFewerWhereTheyDoNot) {
  MemoryFixture fixture;
  ASSERT_TRUE(fixture.Fit(0));
  const double resident = Value(fixture.report.stages.back(), "resident_gib");
  const double needed = Value(fixture.report.stages.back(), "estimated_peak_gib") - resident;
  ASSERT_TRUE(fixture.Fit(resident + 0.6 * needed));
  const StageReport& stage = fixture.report.stages.back();
  EXPECT_EQ(stage.status, StageStatus::kWarning);
  EXPECT_LT(fixture.fitted.size(), 45000u);
  EXPECT_GT(fixture.fitted.size(), 10000u);
  EXPECT_LE(Value(stage, "reduced_peak_gib"), Value(stage, "limit_gib"));
  EXPECT_EQ(Value(stage, "tracks_out"), static_cast<double>(fixture.fitted.size()));
  std::map<image_t, int> per_image;
  for (const Track& track : fixture.fitted) {
    for (const TrackElement& element : track) ++per_image[element.image_id];
  }
  EXPECT_EQ(per_image.size(), 9u);  // as many as have tracks
}

TEST(FitTracksToMemory, RefusesWhatCannotFit) {
  MemoryFixture fixture;
  EXPECT_FALSE(fixture.Fit(0.001));
  EXPECT_THAT(fixture.report.failure, HasSubstr("memory: even with 50 tracks an image, "));
  EXPECT_THAT(fixture.report.failure, HasSubstr("raise --reconstruct.max_memory_gib"));
}

TEST(Reconstruct, SaysWhatItWillTakeAndRefusesWithoutMemory) {
  const Database database = MakeDatabase(MakeScene(SmallScene(), 1));
  ReconstructSettings settings;
  const RunReport report = Reconstruct(database, settings).report;
  const StageReport* stage = FindStage(report, "memory");
  ASSERT_NE(stage, nullptr);
  EXPECT_EQ(Value(*stage, "tracks_in"), Value(*stage, "tracks_out"));
  settings.reconstruct.max_memory_gib = 0.001;
  const ReconstructResult refused = Reconstruct(database, settings);
  EXPECT_TRUE(refused.models.empty());
  EXPECT_THAT(refused.report.failure, HasSubstr("read: the memory is too small for "));
  EXPECT_THAT(refused.report.failure, HasSubstr("raise --reconstruct.max_memory_gib"));
  EXPECT_EQ(FindStage(refused.report, "view_graph"), nullptr);
  EXPECT_EQ(FindStage(refused.report, "bundle_adjustment"), nullptr);
}

}  // namespace
}  // namespace cairn
