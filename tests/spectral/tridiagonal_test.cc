#include "invgrad/spectral/routes/tridiagonal.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/spectral_reference.h"

namespace invgrad {
namespace tridiagonal_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Complex = std::complex<double>;
using Random = RandomMatrices;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Matrix {
  std::string name;
  VectorXd a;  // m
  VectorXd e;  // m - 1

  Index size() const { return a.size(); }
  MatrixXd Dense() const {
    MatrixXd T = a.asDiagonal();
    for (Index i = 0; i + 1 < size(); ++i) T(i + 1, i) = T(i, i + 1) = e[i];
    return T;
  }
  Tridiagonal Packed() const {
    Tridiagonal T;
    T.Set(a, e);
    return T;
  }
  VectorXd Eigenvalues() const { return SymmetricEigen(Dense()).values; }
};

// (-1, 2, -1): eigenvalues 2 - 2 cos(k pi / (m + 1)), k = 1 .. m.
Matrix SecondDifference(Index m) {
  return {"second difference",
          VectorXd::Constant(m, 2.0),
          VectorXd::Constant(m - 1, -1.0)};
}

std::vector<Matrix> Matrices() {
  Random random(1);
  std::vector<Matrix> matrices;
  for (const Index m : {1, 2, 3, 5, 16, 50}) {
    matrices.push_back({"random", random.Vector(m), random.Vector(m - 1)});
  }
  matrices.push_back(SecondDifference(40));
  // As the reduction of a Gram matrix with small eigenvalues: large at the one
  // end, tiny at the other; and upside down.
  Matrix graded{"graded", random.Vector(40).cwiseAbs(), random.Vector(39)};
  for (Index i = 0; i < 40; ++i) {
    graded.a[i] *= std::pow(10.0, -0.4 * i);
    if (i < 39) graded.e[i] *= 0.3 * std::pow(10.0, -0.4 * i - 0.2);
  }
  matrices.push_back(graded);
  matrices.push_back(
      {"graded upwards", graded.a.reverse(), graded.e.reverse()});
  // Falls apart into blocks, one of them of size one.
  Matrix blocks{"blocks", random.Vector(20), random.Vector(19)};
  blocks.e[4] = blocks.e[5] = blocks.e[11] = 0.0;
  matrices.push_back(blocks);
  matrices.push_back({"diagonal", random.Vector(9), VectorXd::Zero(8)});
  matrices.push_back({"zero", VectorXd::Zero(6), VectorXd::Zero(5)});
  // The pivots of a count are zero here without help.
  matrices.push_back({"zero diagonal", VectorXd::Zero(12), VectorXd::Ones(11)});
  return matrices;
}

int CountBelow(const Tridiagonal& T, double shift) {
  int count = -1;
  T.CountBelow(&shift, 1, &count);
  return count;
}

TEST(Tridiagonal, CountsMatchTheClosedForm) {
  for (const Index m : {1, 2, 3, 31, 200}) {
    const Tridiagonal T = SecondDifference(m).Packed();
    for (int k = 1; k <= m; ++k) {
      const double eigenvalue = 2.0 - 2.0 * std::cos(k * M_PI / (m + 1));
      // A few roundings of the entries, of size two.
      const double near = 8.0 * kEpsilon;
      EXPECT_EQ(CountBelow(T, eigenvalue - near), k - 1);
      EXPECT_EQ(CountBelow(T, eigenvalue + near), k);
      EXPECT_NEAR(T.Eigenvalue(k - 1), eigenvalue, near);
    }
    EXPECT_EQ(CountBelow(T, 0.0), 0);
    EXPECT_EQ(CountBelow(T, 4.0), m);
  }
}

TEST(Tridiagonal, EigenvaluesAndCountsMatchADenseSolver) {
  for (const Matrix& matrix : Matrices()) {
    SCOPED_TRACE(matrix.name + " " + std::to_string(matrix.size()));
    const Tridiagonal T = matrix.Packed();
    const VectorXd eigenvalues = matrix.Eigenvalues();
    const double norm = eigenvalues.lpNorm<Eigen::Infinity>();
    const double near = 10.0 * matrix.size() * kEpsilon * norm;
    for (int i = 0; i < matrix.size(); ++i) {
      EXPECT_NEAR(T.Eigenvalue(i), eigenvalues[i], near);
      EXPECT_LE(T.lower_bound(), eigenvalues[i] + near);
      EXPECT_GE(T.upper_bound(), eigenvalues[i] - near);
      // Where there is a gap, the count in it is known.
      if (i + 1 < matrix.size() &&
          eigenvalues[i + 1] - eigenvalues[i] > 4.0 * near) {
        EXPECT_EQ(CountBelow(T, 0.5 * (eigenvalues[i] + eigenvalues[i + 1])),
                  i + 1);
      }
    }
    EXPECT_EQ(CountBelow(T, -3.0 * norm - 1.0), 0);
    EXPECT_EQ(CountBelow(T, 3.0 * norm + 1.0), matrix.size());
  }
}

// A diagonal graded over 20 orders of magnitude: small eigenvalues are found
// relative to themselves if the caller's interval and tolerance are small.
TEST(Tridiagonal, SmallEigenvaluesOfAGradedMatrix) {
  VectorXd a(21);
  for (Index i = 0; i < 21; ++i) a[i] = std::pow(10.0, -i);
  const Matrix matrix{"", a, VectorXd::Zero(20)};
  const Tridiagonal T = matrix.Packed();
  for (int i = 0; i < 21; ++i) {
    const double exact = a[20 - i];
    EXPECT_NEAR(T.Eigenvalue(i, 0.5 * exact, 2.0 * exact, 1e-14 * exact),
                exact,
                1e-14 * exact);
  }
}

// Shifts are handled many at a time: any number gives the same counts.
TEST(Tridiagonal, AnyNumberOfShifts) {
  Random random(2);
  const Matrix matrix{"", random.Vector(30), random.Vector(29)};
  const Tridiagonal T = matrix.Packed();
  const VectorXd shifts = 2.0 * random.Vector(67);
  for (const int count : {0, 1, 3, 15, 16, 17, 31, 67}) {
    std::vector<int> counts(68, -7);
    T.CountBelow(shifts.data(), count, counts.data());
    for (int k = 0; k < count; ++k)
      EXPECT_EQ(counts[k], CountBelow(T, shifts[k]));
    EXPECT_EQ(counts[count], -7) << "written past the end";
  }
}

// (z - T)^-1 h.
Eigen::VectorXcd Resolvent(Tridiagonal* T, Complex z, const VectorXd& h) {
  VectorXd real, imaginary;
  T->ApplyResolvents({z}, {{0.0, 1.0}}, h, &real, nullptr, nullptr);
  T->ApplyResolvents({z}, {{1.0, 0.0}}, h, &imaginary, nullptr, nullptr);
  return real + Complex(0.0, 1.0) * imaginary;
}

// Shifts all over the upper half-plane, some of them at no more than 1e-9 from
// the real axis, and there next to an eigenvalue.
std::vector<Complex> Shifts(const Matrix& matrix, int count, Random* random) {
  const VectorXd eigenvalues = matrix.Eigenvalues();
  std::vector<Complex> z;
  for (int j = 0; j < count; ++j) {
    const double eigenvalue = eigenvalues[(7 * j) % matrix.size()];
    switch (j % 4) {
      case 0:
        z.emplace_back(random->Number(), std::abs(random->Number()));
        break;
      case 1:
        z.emplace_back(random->Number(), 1e-9);
        break;
      case 2:
        z.emplace_back(eigenvalue, 1e-4);
        break;
      default:
        z.emplace_back(eigenvalue + 1e-6, 1e-6);
    }
  }
  return z;
}

// Elimination with partial pivoting is backward stable: the residual is a few
// roundings of (|T| + |z|) |x|, however near z is to an eigenvalue.
TEST(Tridiagonal, ResolventsHaveSmallResiduals) {
  Random random(3);
  for (const Matrix& matrix : Matrices()) {
    SCOPED_TRACE(matrix.name + " " + std::to_string(matrix.size()));
    Tridiagonal T = matrix.Packed();
    const MatrixXd dense = matrix.Dense();
    const VectorXd h = random.Vector(matrix.size());
    for (const Complex z : Shifts(matrix, 12, &random)) {
      const Eigen::VectorXcd x = Resolvent(&T, z, h);
      ASSERT_EQ(x.size(), matrix.size());
      const Eigen::VectorXcd residual = z * x - dense * x - h;
      EXPECT_LE(residual.norm(),
                8.0 * kEpsilon * (dense.norm() + std::abs(z)) * x.norm())
          << z;
    }
  }
}

// y = sum_j Im[c_j x_j] for any number of shifts: one vector of the processor,
// two, and numbers that are no multiples.
TEST(Tridiagonal, ResolventsAddUp) {
  Random random(4);
  for (const Matrix& matrix : Matrices()) {
    SCOPED_TRACE(matrix.name + " " + std::to_string(matrix.size()));
    Tridiagonal T = matrix.Packed();
    const VectorXd h = random.Vector(matrix.size());
    for (const int count : {1, 4, 8, 11}) {
      const std::vector<Complex> z = Shifts(matrix, count, &random);
      std::vector<Complex> c;
      VectorXd expected = VectorXd::Zero(matrix.size());
      double size = 0.0;
      for (int j = 0; j < count; ++j) {
        c.emplace_back(random.Number(), random.Number());
        const Eigen::VectorXcd x = Resolvent(&T, z[j], h);
        expected += (c[j] * x).imag();
        size += std::abs(c[j]) * x.norm();
      }
      VectorXd y = VectorXd::Constant(3, kNaN);  // of another size
      T.ApplyResolvents(z, c, h, &y, nullptr, nullptr);
      ASSERT_EQ(y.size(), matrix.size());
      // The same solutions, bit for bit; sums and products have roundings.
      EXPECT_LE((y - expected).norm(), (4.0 + count) * kEpsilon * size);
    }
  }
}

Tridiagonal::Perturbations Signs(Index m, Random* random) {
  Tridiagonal::Perturbations uv(2 * Tridiagonal::kNumPerturbations, m);
  for (double& sign : uv.reshaped()) {
    sign = random->Number() > 0.0 ? 1.0 : -1.0;
  }
  return uv;
}

// A real shift below the spectrum: Levenberg-Marquardt's.
TEST(Tridiagonal, RealShiftsSolveRealSystems) {
  const Matrix matrix = SecondDifference(25);
  Tridiagonal T = matrix.Packed();
  const VectorXd h = Random(4).Vector(25);
  VectorXd y;
  T.ApplyResolvents({{-0.5, 0.0}}, {{0.0, -1.0}}, h, &y, nullptr, nullptr);
  EXPECT_LE((matrix.Dense() * y + 0.5 * y - h).norm(),
            20.0 * kEpsilon * h.norm());
}

TEST(Tridiagonal, NoShiftsGiveZero) {
  Tridiagonal T = SecondDifference(5).Packed();
  VectorXd y;
  T.ApplyResolvents({}, {}, VectorXd::Ones(5), &y, nullptr, nullptr);
  EXPECT_EQ(y, VectorXd::Zero(5));
}

// Column p: the derivative of y in the size of E_p = (u_p v_p^T + v_p u_p^T) /
// sqrt(2): sum_j Im[c_j (z_j - T)^-1 E_p (z_j - T)^-1 h].
TEST(Tridiagonal, ChangesAreDerivatives) {
  Random random(5);
  for (const Matrix& matrix : Matrices()) {
    SCOPED_TRACE(matrix.name + " " + std::to_string(matrix.size()));
    const Index m = matrix.size();
    const Tridiagonal::Perturbations uv = Signs(m, &random);
    const VectorXd h = random.Vector(m);
    std::vector<Complex> z;
    std::vector<Complex> c;
    for (int j = 0; j < 9; ++j) {
      z.emplace_back(random.Number(), 0.1 + std::abs(random.Number()));
      c.emplace_back(random.Number(), random.Number());
    }
    Tridiagonal T = matrix.Packed();
    VectorXd y;
    Tridiagonal::Changes changes;
    T.ApplyResolvents(z, c, h, &y, &uv, &changes);
    VectorXd alone;
    T.ApplyResolvents(z, c, h, &alone, nullptr, nullptr);
    EXPECT_EQ(y, alone);
    for (int p = 0; p < Tridiagonal::kNumPerturbations; ++p) {
      const VectorXd u = uv.row(2 * p);
      const VectorXd v = uv.row(2 * p + 1);
      VectorXd expected = VectorXd::Zero(m);
      double size = 0.0;
      for (size_t j = 0; j < z.size(); ++j) {
        const Eigen::VectorXcd x = Resolvent(&T, z[j], h);
        const Complex vx = v.cast<Complex>().conjugate().dot(x);
        const Complex ux = u.cast<Complex>().conjugate().dot(x);
        const Eigen::VectorXcd Ex = (u * vx + v * ux) / std::sqrt(2.0);
        const Eigen::VectorXcd change =
            Resolvent(&T, z[j], Ex.real()) +
            Complex(0.0, 1.0) * Resolvent(&T, z[j], Ex.imag());
        expected += (c[j] * change).imag();
        size += std::abs(c[j]) * Ex.norm();
      }
      // Im z_j >= 0.1: |(z_j - T)^-1| <= 10, and roundings are multiplied by
      // at most 10 (|T| + |z_j|).
      const double condition = 10.0 * (matrix.Dense().norm() + 5.0);
      EXPECT_LE((changes.col(p) - expected).norm(),
                10.0 * condition * kEpsilon * 10.0 * size);
      EXPECT_GT(changes.col(p).norm(), 0.0);
    }
  }
}

// The entries of each E_p have variance one, but for those on the diagonal,
// which have more.
TEST(Tridiagonal, PerturbationsAreOfSizeOne) {
  constexpr int kSize = 60;
  Random random(6);
  const Tridiagonal::Perturbations uv = Signs(kSize, &random);
  // (z - T)^-1 E (z - T)^-1 h with T = 0 and z = i is -E h.
  Tridiagonal T;
  T.Set(VectorXd::Zero(kSize), VectorXd::Zero(kSize - 1));
  Eigen::Array4d squared = Eigen::Array4d::Zero();
  VectorXd y;
  Tridiagonal::Changes changes;
  for (int i = 0; i < kSize; ++i) {
    T.ApplyResolvents({{0.0, 1.0}},
                      {{0.0, -1.0}},
                      VectorXd::Unit(kSize, i),
                      &y,
                      &uv,
                      &changes);
    changes.row(i).setZero();  // the diagonal
    squared += changes.colwise().squaredNorm().transpose().array();
  }
  const double num_entries = kSize * (kSize - 1);
  for (const double sum : squared) EXPECT_NEAR(sum / num_entries, 1.0, 0.3);
}

TEST(Tridiagonal, TimesIsTheProduct) {
  Random random(7);
  for (const Matrix& matrix : Matrices()) {
    const VectorXd x = random.Vector(matrix.size());
    VectorXd y;
    matrix.Packed().Times(x, &y);
    EXPECT_LE((y - matrix.Dense() * x).norm(),
              8.0 * kEpsilon * matrix.Dense().norm() * x.norm());
  }
}

TEST(Tridiagonal, RepeatsBitForBitWhateverWasThereBefore) {
  Random random(8);
  const Matrix matrix{"", random.Vector(33), random.Vector(32)};
  const VectorXd h = random.Vector(33);
  const std::vector<Complex> z = Shifts(matrix, 13, &random);
  const std::vector<Complex> c(13, Complex(0.3, -0.7));
  const auto apply = [&](Tridiagonal* T) {
    VectorXd y;
    T->ApplyResolvents(z, c, h, &y, nullptr, nullptr);
    return y;
  };
  Tridiagonal T = matrix.Packed();
  const VectorXd y = apply(&T);
  EXPECT_EQ(apply(&T), y);
  T.Set(VectorXd::Constant(70, kNaN), VectorXd::Constant(69, kNaN));
  VectorXd unused;
  T.ApplyResolvents(z, c, VectorXd::Ones(70), &unused, nullptr, nullptr);
  T.Set(matrix.a, matrix.e);
  EXPECT_EQ(apply(&T), y);
  EXPECT_EQ(T.Eigenvalue(5), matrix.Packed().Eigenvalue(5));
}

TEST(Tridiagonal, NaNEnds) {
  for (const double bad : {kNaN, std::numeric_limits<double>::infinity()}) {
    Matrix matrix = SecondDifference(10);
    matrix.a[3] = bad;
    Tridiagonal T = matrix.Packed();
    T.Eigenvalue(4);  // ends
    T.Eigenvalue(4, 0.0, 4.0, 1e-12);
    EXPECT_GE(CountBelow(T, 1.0), 0);
    EXPECT_LE(CountBelow(T, 1.0), 10);
    VectorXd y;
    T.ApplyResolvents(
        {{1.0, 1.0}}, {{1.0, 0.0}}, VectorXd::Ones(10), &y, nullptr, nullptr);
    EXPECT_FALSE(y.allFinite());
  }
  EXPECT_GE(CountBelow(SecondDifference(10).Packed(), kNaN), 0);
}

TEST(TridiagonalDeathTest, ChecksSizes) {
  Tridiagonal T;
  EXPECT_DEATH(T.Set(VectorXd(), VectorXd()), "m > 0");
  EXPECT_DEATH(T.Set(VectorXd::Ones(3), VectorXd::Ones(3)), "off_diagonal");
  T.Set(VectorXd::Ones(3), VectorXd::Ones(2));
  EXPECT_DEATH(T.Eigenvalue(3), "index");
  EXPECT_DEATH(T.Eigenvalue(-1), "index");
  VectorXd y;
  Tridiagonal::Changes changes;
  EXPECT_DEATH(T.Times(VectorXd::Ones(2), &y), "x.size");
  EXPECT_DEATH(T.ApplyResolvents(
                   {{1.0, 1.0}}, {}, VectorXd::Ones(3), &y, nullptr, &changes),
               "z.size");
}

}  // namespace tridiagonal_test
}  // namespace invgrad
