/* Complex functions that numpy imports and wine 8 lacks. */
#include <math.h>

typedef double _Complex z;
typedef float _Complex c;

static z of(double re, double im)
{
    z r;
    __real__ r = re;
    __imag__ r = im;
    return r;
}

#define EACH(name, expression)                 \
    z ht_##name(z v)                           \
    {                                          \
        double x = __real__ v, y = __imag__ v; \
        return expression;                     \
    }                                          \
    z ht_##name##l(z v)                        \
    {                                          \
        return ht_##name(v);                   \
    }                                          \
    c ht_##name##f(c v)                        \
    {                                          \
        return (c)ht_##name((z)v);             \
    }
#define REAL(name, expression)                 \
    double ht_##name(z v)                      \
    {                                          \
        double x = __real__ v, y = __imag__ v; \
        (void)x;                               \
        (void)y;                               \
        return expression;                     \
    }                                          \
    double ht_##name##l(z v)                   \
    {                                          \
        return ht_##name(v);                   \
    }                                          \
    float ht_##name##f(c v)                    \
    {                                          \
        return (float)ht_##name((z)v);         \
    }

static z over(z a, z b)
{
    double x = __real__ b, y = __imag__ b, d = x * x + y * y;
    return of((__real__ a * x + __imag__ a * y) / d, (__imag__ a * x - __real__ a * y) / d);
}

REAL(creal, x)
REAL(cimag, y)
REAL(cabs, hypot(x, y))
REAL(carg, atan2(y, x))
EACH(cexp, of(exp(x) * cos(y), exp(x) * sin(y)))
EACH(ccosh, of(cosh(x) * cos(y), sinh(x) * sin(y)))
EACH(csinh, of(sinh(x) * cos(y), cosh(x) * sin(y)))
EACH(ccos, of(cos(x) * cosh(y), -sin(x) * sinh(y)))
EACH(csin, of(sin(x) * cosh(y), cos(x) * sinh(y)))
EACH(ctanh, over(ht_csinh(of(x, y)), ht_ccosh(of(x, y))))
EACH(ctan, over(ht_csin(of(x, y)), ht_ccos(of(x, y))))

z ht_cpow(z v, z w)
{
    double r = log(ht_cabs(v)), a = ht_carg(v), p = __real__ w, q = __imag__ w;
    return (r == -INFINITY) ? of(0, 0) : ht_cexp(of(p * r - q * a, p * a + q * r));
}
z ht_cpowl(z v, z w)
{
    return ht_cpow(v, w);
}
c ht_cpowf(c v, c w)
{
    return (c)ht_cpow((z)v, (z)w);
}
