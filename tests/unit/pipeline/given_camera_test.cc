// Camera parameters as users mistake them.
#include "pipeline/stages/given_camera.h"

#include "support/test.h"

namespace cairn {
namespace {

Camera Given(CameraModel model, const std::vector<double>& params) {
  return {1, model, 600, 450, params, true};
}

// "": there is none.
std::string FaultOf(CameraModel model, const std::vector<double>& params) {
  const std::optional<ResultWarning> fault = FindFault(Given(model, params));
  return fault ? WarningText(*fault) : "";
}

// The one doubt about a camera without a fault; "" where there is another number of things.
std::string DoubtAbout(CameraModel model, const std::vector<double>& params,
                       std::optional<double> exif_focal_px = std::nullopt) {
  const Camera camera = Given(model, params);
  const std::vector<ResultWarning> doubts = FindDoubts(camera, exif_focal_px);
  return doubts.size() == 1 && !FindFault(camera) ? WarningText(doubts[0]) : "";
}

void ExpectFine(const Camera& camera, std::optional<double> exif_focal_px) {
  const std::string model(CameraModelName(camera.model));
  EXPECT_FALSE(FindFault(camera)) << model;
  EXPECT_TRUE(FindDoubts(camera, exif_focal_px).empty()) << model;
}

TEST(GivenCamera, WhatLensesHaveIsNotOdd) {
  for (const Camera& camera :
       {Given(CameraModel::kPinhole, {485, 485, 300, 225}),
        Given(CameraModel::kPinhole, {485, 485, 340, 190}),
        Given(CameraModel::kSimpleRadial, {400, 300, 225, -0.3}),
        Given(CameraModel::kOpenCV, {420, 420, 300, 225, -0.28, 0.07, 0.001, 0.001})}) {
    ExpectFine(camera, 480.0);
  }
  for (const NamedValue<CameraModel>& model : NamedCameraModels()) {
    ExpectFine(Camera::FromFocal(1, model.value, 485, 600, 450), 485.0);
  }
  // Of 180 degrees and more, to the border and in a circle.
  for (const double focal : {191.0, 143.0, 90.0}) {
    ExpectFine(Camera::FromFocal(1, CameraModel::kOpenCVFisheye, focal, 600, 450), std::nullopt);
  }
}

TEST(GivenCamera, PrincipalPointsOutsideTheImage) {
  EXPECT_THAT(FaultOf(CameraModel::kPinhole, {970, 970, 600, 450}),
              AllOf(StartsWith("the principal point 600,450 lies outside photographs of 600 x 450"),
                    HasSubstr("2 times as large? Here it is then 485,485,300,225")));
  EXPECT_THAT(FaultOf(CameraModel::kSimpleRadial, {1665, 1026, 770, 0.1}),
              HasSubstr("3.42 times as large? Here it is then 486.684,"));
  EXPECT_THAT(FaultOf(CameraModel::kPinhole, {300, 225, 485, 485}),
              AllOf(HasSubstr("485,485 lies outside"),
                    HasSubstr("PINHOLE has fx,fy,cx,cy in pixels of these photographs")));
  EXPECT_THAT(FaultOf(CameraModel::kPinhole, {485, 485, 3000, 225}), HasSubstr("3000,225"));
  EXPECT_THAT(FaultOf(CameraModel::kFisheye, {485, 485, -3, 225}), HasSubstr("-3,225"));
}

TEST(GivenCamera, FocalLengthsOfNoPhotograph) {
  EXPECT_THAT(FaultOf(CameraModel::kPinhole, {6, 6, 300, 225}),
              StartsWith("no photograph of 600 x 450 pixels has a focal length of 6 pixels"));
  EXPECT_NE(FaultOf(CameraModel::kPinhole, {485, 30000, 300, 225}), "");
}

TEST(GivenCamera, DistortionsThatLeaveNoCamera) {
  EXPECT_THAT(
      FaultOf(CameraModel::kSimpleRadial, {485, 485, 300, 225}),
      AllOf(StartsWith("the distortion moves pixels half way to the border by a factor"),
            HasSubstr("SIMPLE_RADIAL has f,cx,cy in pixels of these photographs, and 1 of")));
  EXPECT_THAT(FaultOf(CameraModel::kSimpleRadialFisheye, {485, 485, 300, 225}),
              StartsWith("the distortion moves"));
  EXPECT_THAT(FaultOf(CameraModel::kSimpleRadial, {485, 300, 225, -20}),
              StartsWith("the distortion leaves pixels half way to the border without"));
}

TEST(GivenCamera, WhatIsDoubtful) {
  EXPECT_THAT(DoubtAbout(CameraModel::kPinhole, {243, 243, 150, 112}),
              AllOf(HasSubstr("principal point 150,112 is far from the center"),
                    HasSubstr("0.5 times as large? Here it is then 486,486,300,224")));
  EXPECT_THAT(DoubtAbout(CameraModel::kPinhole, {485, 485, 450, 225}),
              HasSubstr("are camera_model and the order right?"));
  EXPECT_THAT(DoubtAbout(CameraModel::kPinhole, {970, 970, 300, 225}, 485.4),
              HasSubstr("the given focal length of 970 pixels is not EXIF's, 485"));
  EXPECT_EQ(DoubtAbout(CameraModel::kPinhole, {600, 600, 300, 225}, 485.4), "");
}

}  // namespace
}  // namespace cairn
